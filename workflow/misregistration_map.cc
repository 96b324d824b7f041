#include "workflow/misregistration_map.h"

#include <algorithm>

#include "core/text.h"
#include "workflow/html_text.h"

namespace roomtex {
namespace {

// As .ramp of the page's style: blue at 0, red from 1 on.
std::string RampColor(double share) {
  constexpr double kBlue[] = {0x3b, 0x78, 0xb5}, kRed[] = {0xc9, 0x35, 0x35};
  std::string color = "rgb(";
  for (int k = 0; k < 3; ++k) {
    color += (k > 0 ? "," : "") +
             Number(kBlue[k] + std::clamp(share, 0.0, 1.0) * (kRed[k] - kBlue[k]), 0);
  }
  return color + ")";
}

}  // namespace

std::string MisregistrationMap(const Json& shift_map_px) {
  constexpr int kCell = 7;  // pixels of the page
  if (!shift_map_px.is_array()) return "";
  std::string cells;
  double worst = -1;
  size_t num_columns = 0;
  for (size_t row = 0; row < shift_map_px.size(); ++row) {
    const Json& line = shift_map_px[row];
    num_columns = std::max(num_columns, line.size());
    for (size_t column = 0; column < line.size(); ++column) {
      if (!line[column].is_number()) continue;
      const double shift = line[column];
      worst = std::max(worst, shift);
      cells += "<rect x=\"" + std::to_string(kCell * column) + "\" y=\"" +
               std::to_string(kCell * row) + "\" width=\"" + std::to_string(kCell) +
               "\" height=\"" + std::to_string(kCell) + "\" fill=\"" +
               RampColor(shift / kWorstShift) + "\"/>";
    }
  }
  if (worst < 0) return "";
  const std::string width = std::to_string(kCell * num_columns),
                    height = std::to_string(kCell * shift_map_px.size());
  return "<svg class=\"map\" role=\"img\" shape-rendering=\"crispEdges\" width=\"" + width +
         "\" height=\"" + height + "\" viewBox=\"0 0 " + width + " " + height + "\">" +
         HtmlTag("title", "off by up to " + Number(worst, 1) + " px") + cells + "</svg>";
}

}  // namespace roomtex
