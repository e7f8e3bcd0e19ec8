#pragma once

#include "core/surface.h"

#include <Eigen/Core>

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace afterglow {

/// Reads `x,y,z,nx,ny,nz`, one point a line, in the scene's unit; a first line of names is skipped.
/// Normals are normalised. Strict: anything else than six finite numbers, a zero normal or a file
/// without points throws FileError with the number of the line.
std::vector<SurfacePoint> read_points_csv(const std::string& path);

/// Says on stderr how many places of a file, of so many, lay off the surfaces.
void tell_of_moved_places(const PlacesMoved& moved, std::size_t count);

/// Writes the header `E_r,E_g,E_b` and one line a column with as many digits as give the same float
/// back. The file appears whole or not at all.
void write_irradiance_csv(const std::string& path, const Eigen::Array3Xf& irradiance);

/// Reads the points of one file and writes an irradiance for each into another, as the two above do, in blocks
/// of `block` points: what it takes of memory does not grow with their number, and either file may be a
/// pipe. `answer` gives a column for each point of a block, which it may change. What is wrong with a point is found when it is
/// reached; a file then does not appear, while into a pipe the blocks before it have been written.
void answer_points_csv(const std::string& points, const std::string& output,
                       const std::function<Eigen::Array3Xf(std::span<SurfacePoint>)>& answer,
                       std::size_t block = 16384);

/// Reads what write_irradiance_csv() writes, as strictly (the header may be missing).
Eigen::Array3Xf read_irradiance_csv(const std::string& path);

} // namespace afterglow
