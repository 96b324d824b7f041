#include "core/json_text.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

constexpr int kMaxJsonDepth = 64;
constexpr uintmax_t kMaxJsonBytes = uintmax_t{1} << 28;

}  // namespace

Json ParseJson(const std::string& text, const std::string& path, const std::string& remedy) {
  bool too_deep = false;
  const auto look = [&](int depth, Json::parse_event_t, Json&) {
    if (depth > kMaxJsonDepth) too_deep = true;
    return !too_deep;  // what is too deep is dropped
  };
  Json json;
  try {
    json = Json::parse(text, look);
  } catch (const Json::parse_error& error) {
    throw InputError(path, BytePosition(static_cast<long long>(error.byte)), "is no JSON", remedy);
  } catch (const Json::exception&) {  // the only other one
    throw InputError(path, "", "holds a number beyond 1e308", remedy);
  }
  if (too_deep) {
    throw InputError(path, "", "is nested deeper than " + std::to_string(kMaxJsonDepth) + " levels",
                     remedy);
  }
  return json;
}

Json ReadJson(const std::string& path, const std::string& remedy) {
  RequireFile(path, remedy);
  std::error_code error;
  if (const uintmax_t size = std::filesystem::file_size(path, error);
      !error && size > kMaxJsonBytes) {
    throw InputError(path, "", "is larger than 256 MiB", remedy);
  }
  std::ifstream stream(path, std::ios::binary);
  return ParseJson({std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()}, path,
                   remedy);
}

Json ReadJsonIfAny(const std::string& path) {
  try {
    return ReadJson(path, "");
  } catch (const InputError&) {
    return nullptr;
  }
}

}  // namespace roomtex
