#pragma once

#include "core/types.h"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace afterglow {

/// Reads `x,y,z,nx,ny,nz`, one point a line, in the scene's unit; a first line of names is skipped.
/// Normals are normalised. Strict: anything else than six finite numbers, a zero normal or a file
/// without points throws FileError with the number of the line.
std::vector<SurfacePoint> read_points_csv(const std::string& path);

/// Writes the header `E_r,E_g,E_b` and one line a column with as many digits as give the same float
/// back. The file appears whole or not at all.
void write_irradiance_csv(const std::string& path, const Eigen::Array3Xf& irradiance);

/// Reads what write_irradiance_csv() writes, as strictly (the header may be missing).
Eigen::Array3Xf read_irradiance_csv(const std::string& path);

} // namespace afterglow
