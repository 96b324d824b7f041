#pragma once
// Units of length in scan files.

#include <optional>
#include <string>
#include <vector>

namespace roomtex {

// Metres per unit of the given name: "inches", "feet", "meters", "mm" ... in any case, singular,
// plural or abbreviated. "us_survey_feet" are 2 millionths longer than feet: a metre in the
// coordinates of a state. None for a name that is not known.
std::optional<double> MetersPerUnit(const std::string& name);

// The value of --units for a name that MetersPerUnit knows; "" for others.
std::string LengthUnitOf(const std::string& name);

// The values of --units.
const std::vector<std::string>& LengthUnitNames();

}  // namespace roomtex
