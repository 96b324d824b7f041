#pragma once
// Opens a page in the user's browser.

#include <string>

namespace roomtex {

struct OpenedPage {
  std::string problem;  // a sentence that says why nothing was opened; "" = opened
  std::string folder;   // to be removed at the end, "" = none: it holds the file below
};
// The URL holds a secret and must not stand in a list of processes: the browser is given a file
// that leads there, in a folder of its own that only this user may read.
OpenedPage OpenPage(const std::string& url);

}  // namespace roomtex
