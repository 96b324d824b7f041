#include "importers/length_unit.h"

#include <map>

#include "core/text.h"

namespace roomtex {

std::optional<double> MetersPerUnit(const std::string& name) {
  static const std::map<std::string, double> kMeters = {{"m", 1.0},
                                                        {"meter", 1.0},
                                                        {"meters", 1.0},
                                                        {"metre", 1.0},
                                                        {"metres", 1.0},
                                                        {"mm", 1e-3},
                                                        {"millimeter", 1e-3},
                                                        {"millimeters", 1e-3},
                                                        {"millimetre", 1e-3},
                                                        {"millimetres", 1e-3},
                                                        {"cm", 1e-2},
                                                        {"centimeter", 1e-2},
                                                        {"centimeters", 1e-2},
                                                        {"centimetre", 1e-2},
                                                        {"centimetres", 1e-2},
                                                        {"ft", 0.3048},
                                                        {"foot", 0.3048},
                                                        {"feet", 0.3048},
                                                        {"us_survey_feet", 1200.0 / 3937},
                                                        {"in", 0.0254},
                                                        {"inch", 0.0254},
                                                        {"inches", 0.0254}};
  const auto found = kMeters.find(LowerCase(name));
  if (found == kMeters.end()) return std::nullopt;
  return found->second;
}

std::string LengthUnitOf(const std::string& name) {
  const std::optional<double> meters = MetersPerUnit(name);
  for (const std::string& unit : LengthUnitNames()) {
    if (meters && MetersPerUnit(unit) == meters) return unit;
  }
  return "";
}

const std::vector<std::string>& LengthUnitNames() {
  static const std::vector<std::string> kNames = {"meters", "millimeters",    "centimeters",
                                                  "feet",   "us_survey_feet", "inches"};
  return kNames;
}

}  // namespace roomtex
