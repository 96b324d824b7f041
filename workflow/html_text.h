#pragma once
// Text and pictures as they may stand in a page.

#include <cstdint>
#include <string>
#include <vector>

#include "core/report.h"

namespace roomtex {

// With <, >, & and quotes written so that they are only text.
std::string HtmlText(const std::string& text);
// <tag>text</tag>; tag: "td class=\"n\"".
std::string HtmlTag(const std::string& tag, const std::string& text);
// A whole page in the look of all reports, with nothing from outside.
std::string HtmlPage(const std::string& title, const std::string& body);
// "Trusted", of a verdict's state; it is the class of the header, too.
std::string VerdictWord(const std::string& state);
// What to do; a command line behind the sentence is set apart.
std::string HtmlRemedy(const std::string& text);

// "1.2 GB", "35.1 s" or "about 3 min".
std::string MemoryText(double bytes);
std::string TimeText(double seconds);
// A number and its unit stay on one line.
std::string WithUnits(std::string text);
// A cell of a table; a dash where there is no number.
std::string HtmlCell(const Json& json, const char* key, double factor, int digits);

// An <img> of a picture file, at most `max_width` pixels wide, JPEG in itself; "" if it cannot be
// read.
std::string HtmlPicture(const std::string& path, int max_width, const std::string& alt);

}  // namespace roomtex
