#pragma once

#include "transport/spotlight.h"

#include <map>
#include <string>
#include <vector>

namespace afterglow {

/// Six digits: "0.25", "1e-05".
std::string number_text(double value);

/// A light as string attributes of a picture: afterglow.light_position ...
std::map<std::string, std::string> light_attributes(const Spotlight& light);

/// Before a long computation: throws FileError where an output cannot be made because its folder is
/// missing or may not be written to, UsageError where two of the outputs, or an output and an input, are
/// one file, or where the first output has no name. Other empty names, and devices, are nobody's.
void check_outputs(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs);

/// Throws UsageError where a scene's name is not what transfer files and reports can hold: one line of UTF-8 of at
/// most 4096 bytes.
void check_scene_name(const std::string& scene);

} // namespace afterglow
