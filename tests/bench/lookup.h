#pragma once

#include <string>

namespace afterglow {

/// Finds the functions of the finest senders at the ends of gather rays in three ways, and prints what one
/// takes: the R-tree and a hash grid, both of spheres, and the row of the patch that a ray meets.
void run_lookup(const std::string& scene);

} // namespace afterglow
