#include "importers/ply_header.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int64_t kLongestPlyHeader = 1 << 20;  // bytes

std::optional<PlyType> TypeFromName(const std::string& name) {
  static const std::pair<const char*, PlyType> kTypes[] = {
      {"char", PlyType::kInt8},     {"int8", PlyType::kInt8},     {"uchar", PlyType::kUint8},
      {"uint8", PlyType::kUint8},   {"short", PlyType::kInt16},   {"int16", PlyType::kInt16},
      {"ushort", PlyType::kUint16}, {"uint16", PlyType::kUint16}, {"int", PlyType::kInt32},
      {"int32", PlyType::kInt32},   {"uint", PlyType::kUint32},   {"uint32", PlyType::kUint32},
      {"float", PlyType::kFloat},   {"float32", PlyType::kFloat}, {"double", PlyType::kDouble},
      {"float64", PlyType::kDouble}};
  for (const auto& [known, type] : kTypes) {
    if (name == known) return type;
  }
  return std::nullopt;
}

bool ParseFormat(const std::vector<std::string>& words, PlyHeader* header) {
  if (words.size() != 3) return false;
  if (words[1] == "ascii") header->format = "ascii";
  if (words[1] == "binary_little_endian") header->format = "little";
  if (words[1] == "binary_big_endian") header->format = "big";
  return !header->format.empty();
}

bool ParseElement(const std::vector<std::string>& words, long line, PlyHeader* header) {
  if (words.size() != 3) return false;
  PlyElement element;
  element.name = words[1];
  element.line = line;
  const char* const end = words[2].data() + words[2].size();
  const auto [next, error] = std::from_chars(words[2].data(), end, element.count);
  if (error != std::errc() || next != end || element.count < 0) return false;
  header->elements.push_back(element);
  return true;
}

bool ParseProperty(const std::vector<std::string>& words, PlyHeader* header) {
  if (header->elements.empty()) return false;
  PlyProperty property;
  property.is_list = words.size() == 5 && words[1] == "list";
  if (!property.is_list && words.size() != 3) return false;
  const std::optional<PlyType> type = TypeFromName(words[words.size() - 2]);
  if (!type) return false;
  property.type = *type;
  property.name = words.back();
  if (property.is_list) {
    const std::optional<PlyType> count_type = TypeFromName(words[2]);
    if (!count_type || *count_type == PlyType::kFloat || *count_type == PlyType::kDouble)
      return false;
    property.count_type = *count_type;
  }
  header->elements.back().properties.push_back(property);
  return true;
}

void CheckCounts(const FileReader& file, const PlyHeader& header) {
  const auto left = static_cast<double>(file.size() - header.body_offset);
  for (const PlyElement& element : header.elements) {
    double smallest = 0;  // bytes of one entry
    for (const PlyProperty& property : element.properties) {
      smallest += header.format == "ascii"
                      ? 2
                      : PlyTypeSize(property.is_list ? property.count_type : property.type);
    }
    if (smallest * static_cast<double>(element.count) <= left + 1) continue;
    throw InputError(file.path(), LinePosition(element.line),
                     "says " + std::to_string(element.count) + " of " + element.name +
                         ", but only " + std::to_string(file.size() - header.body_offset) +
                         " bytes follow the header",
                     "The file is cut off or its header damaged");
  }
}

}  // namespace

int PlyTypeSize(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kDouble:
      return 8;
    default:
      return 4;
  }
}

int PlyElement::Find(const std::vector<std::string>& names) const {
  for (size_t i = 0; i < properties.size(); ++i) {
    if (std::find(names.begin(), names.end(), properties[i].name) != names.end()) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

PlyHeader ReadPlyHeader(const FileReader& file) {
  LineReader lines(file);
  PlyHeader header;
  std::string_view line;
  if (!lines.Next(&line) || WordsOf(line) != std::vector<std::string>{"ply"}) {
    throw InputError(file.path(), LinePosition(1), "does not begin with \"ply\"",
                     "Give a PLY file");
  }
  while (true) {
    if (lines.offset() > kLongestPlyHeader || !lines.Next(&line)) {
      throw InputError(file.path(), BytePosition(lines.offset()),
                       "the header does not end: no line \"end_header\" up to here",
                       "The file is cut off or damaged: copy it again");
    }
    const std::vector<std::string> words = WordsOf(line);
    if (words.empty()) continue;
    if (words[0] == "end_header") break;
    bool good = true;
    if (words[0] == "comment") {
      header.comments.emplace_back(line.substr(line.find("comment") + 7));
    } else if (words[0] == "format") {
      good = ParseFormat(words, &header);
    } else if (words[0] == "element") {
      good = ParseElement(words, lines.line_number(), &header);
    } else if (words[0] == "property") {
      good = ParseProperty(words, &header);
    } else {
      good = words[0] == "obj_info";
    }
    if (!good) {
      throw InputError(file.path(), LinePosition(lines.line_number()),
                       "is " + Quoted(line) + ", which is no line of a PLY header",
                       "The file is damaged");
    }
  }
  if (header.format.empty()) {
    throw InputError(file.path(), LinePosition(lines.line_number()),
                     "the header ends without a \"format\" line", "The file is damaged");
  }
  header.body_offset = lines.offset();
  header.num_lines = lines.line_number();
  CheckCounts(file, header);
  return header;
}

}  // namespace roomtex
