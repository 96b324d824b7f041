#pragma once
// The files of a web page, built into the binary by roomtex_page() of
// scripts/cmake/pages.cmake.

#include <string_view>
#include <vector>

namespace roomtex {

class LocalServer;

struct PageFile {
  std::string_view name;  // "pick.js"; "index.html" is the page itself
  std::string_view bytes;
};
using Page = std::vector<PageFile>;

// Each as "/" + name with the type that its extension says, index.html as "/". Throws
// std::logic_error for an extension that no page of ours has.
void AddPage(const Page& page, LocalServer* server);

}  // namespace roomtex
