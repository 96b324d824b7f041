#include "core/page.h"

#include <map>
#include <stdexcept>
#include <string>

#include "core/local_server.h"

namespace roomtex {

void AddPage(const Page& page, LocalServer* server) {
  static const std::map<std::string_view, const char*> kTypes = {
      {"html", "text/html; charset=utf-8"},
      {"css", "text/css; charset=utf-8"},
      {"js", "text/javascript; charset=utf-8"},
      {"svg", "image/svg+xml"},
      {"png", "image/png"},
      {"txt", "text/plain; charset=utf-8"},
  };
  for (const PageFile& file : page) {
    const auto type = kTypes.find(file.name.substr(file.name.rfind('.') + 1));
    if (type == kTypes.end()) {
      throw std::logic_error("no type for the page's file " + std::string(file.name));
    }
    const std::string path = file.name == "index.html" ? "" : std::string(file.name);
    server->AddAsset("/" + path, type->second, std::string(file.bytes));
  }
}

}  // namespace roomtex
