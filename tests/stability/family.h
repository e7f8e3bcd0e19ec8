#pragma once

#include <functional>
#include <string>
#include <vector>

namespace afterglow {

struct Figure {
    std::string name; // with the unit
    double value = 0.0;
};

/// A share as a figure in percent.
Figure percent(const std::string& name, double share);

/// Scenes that differ in one number, the dial.
struct Family {
    std::string name;           // as it is called on the command line and in files
    std::string dial;           // what is turned, with the unit
    std::vector<double> values; // of the dial
    std::function<std::vector<Figure>(double)> measure; // the same figures at every value
};

std::vector<Family> geometry_families();
std::vector<Family> light_families();
std::vector<Family> input_families();

/// Measures value by value, prints a table and, unless `folder` is empty, writes
/// FOLDER/NAME.csv: one line a value of the dial, its figures beside it. A value where the
/// measurement throws an Error is printed with the message and left out of the file.
void report(const Family& family, const std::string& folder);

} // namespace afterglow
