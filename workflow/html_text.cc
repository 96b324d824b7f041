#include "workflow/html_text.h"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/text.h"
#include "workflow/remaining_time.h"
#include "workflow/report_style.h"

namespace roomtex {

std::string HtmlText(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '&':
        safe += "&amp;";
        break;
      case '"':
        safe += "&quot;";
        break;
      case '\'':
        safe += "&#39;";
        break;
      default:
        safe += c;
    }
  }
  return safe;
}

std::string HtmlTag(const std::string& tag, const std::string& text) {
  return "<" + tag + ">" + HtmlText(text) + "</" + tag.substr(0, tag.find(' ')) + ">";
}

std::string HtmlPage(const std::string& title, const std::string& body) {
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta "
         "name=\"viewport\" content=\"width=device-width, initial-scale=1\"><meta "
         "name=\"generator\" content=\"roomtex\">" +
         HtmlTag("title", title) + "<style>" + kReportStyle + "</style></head>\n<body><main>\n" +
         body + "</main></body></html>\n";
}

std::string VerdictWord(const std::string& state) {
  return state == "trusted"     ? "Trusted"
         : state == "untrusted" ? "Not to be trusted"
         : state == "failed"    ? "Failed"
                                : "Not finished";
}

std::string HtmlRemedy(const std::string& text) {
  const size_t command = text.find(": roomtex-");
  if (command == std::string::npos) return HtmlText(text);
  return HtmlText(text.substr(0, command + 1)) + HtmlTag("pre", text.substr(command + 2));
}

std::string MemoryText(double bytes) {
  return bytes < 1e9 ? Number(bytes / 1e6, 0) + " MB" : Number(bytes / 1e9, 1) + " GB";
}

std::string TimeText(double seconds) {
  return seconds < 100 ? Number(seconds, 1) + " s" : DurationText(seconds);
}

std::string WithUnits(std::string text) {
  for (const char* unit : {" %", " mm", " m", " px", " s", " min", " GB", " MB"}) {
    for (size_t at = text.find(unit); at != std::string::npos; at = text.find(unit, at + 1)) {
      const bool follows_number = at > 0 && std::isdigit(static_cast<unsigned char>(text[at - 1]));
      if (follows_number) text.replace(at, 1, "\u00a0");
    }
  }
  return text;
}

std::string HtmlCell(const Json& json, const char* key, double factor, int digits) {
  const bool has = json.contains(key) && json[key].is_number();
  return HtmlTag("td class=\"n\"",
                 has ? Number(factor * json[key].get<double>(), digits) : "\u2013");
}

std::string HtmlPicture(const std::string& path, int max_width, const std::string& alt) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return "";
  cv::Mat picture = cv::imread(path, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (picture.empty()) return "";
  if (picture.cols > max_width) {
    const double scale = static_cast<double>(max_width) / picture.cols;
    cv::resize(picture, picture, {}, scale, scale, cv::INTER_AREA);
  }
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, 82});
  return "<img alt=\"" + HtmlText(alt) + "\" width=\"" + std::to_string(picture.cols) +
         "\" height=\"" + std::to_string(picture.rows) + "\" src=\"data:image/jpeg;base64," +
         Base64(bytes.data(), bytes.size()) + "\">";
}

}  // namespace roomtex
