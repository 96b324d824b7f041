#pragma once
// Text and pictures as they may stand in a page.

#include <cstdint>
#include <string>
#include <vector>

namespace roomtex {

// With <, >, & and quotes written so that they are only text.
std::string HtmlText(const std::string& text);
std::string Base64(const std::vector<uint8_t>& bytes);
// An <img> of a picture file, at most `max_width` pixels wide, JPEG in itself; "" if it cannot be
// read.
std::string HtmlPicture(const std::string& path, int max_width, const std::string& alt);

}  // namespace roomtex
