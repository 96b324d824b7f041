#include "core/near_hint.h"

#include <optional>
#include <vector>

#include "core/error.h"
#include "core/text.h"

namespace roomtex {

NearHint ParseNearHint(const std::string& text) {
  const auto fail = [&text]() -> UsageError {
    return UsageError("--near is \"" + text +
                      "\": expected PHOTO,X,Y,Z, a photo and a place of the scan that it shows "
                      "(metres, scan frame)");
  };
  std::vector<size_t> commas;
  for (size_t at = text.size(); at-- > 0 && commas.size() < 3;) {
    if (text[at] == ',') commas.push_back(at);
  }
  if (commas.size() < 3 || commas[2] == 0) throw fail();
  NearHint hint;
  hint.image_name = text.substr(0, commas[2]);
  for (int k = 0; k < 3; ++k) {
    const size_t begin = commas[2 - k] + 1;
    const size_t end = k < 2 ? commas[1 - k] : text.size();
    const std::optional<double> number = ParseNumber(Trimmed(text.substr(begin, end - begin)));
    if (!number) throw fail();
    hint.x_in_scan[k] = *number;
  }
  return hint;
}

}  // namespace roomtex
