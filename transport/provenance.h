#pragma once

#include "transport/spotlight.h"

#include <map>
#include <string>

namespace afterglow {

/// Six digits: "0.25", "1e-05".
std::string number_text(double value);

/// A light as string attributes of a picture: afterglow.light_position ...
std::map<std::string, std::string> light_attributes(const Spotlight& light);

/// Throws FileError where no file of this name can be made because its folder is missing or may not
/// be written to, so that a long computation does not end there.
void check_output(const std::string& path);

} // namespace afterglow
