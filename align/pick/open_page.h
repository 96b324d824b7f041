#pragma once
// Opens a page in the user's browser.

#include <string>

namespace roomtex {

// The URL holds a secret and must not stand in a list of processes: the browser is given a file
// that leads there, in a folder of its own that only this user may read (and which stays: browsers
// read it later). Gives "", or a sentence that says why nothing was opened.
std::string OpenPage(const std::string& url);

}  // namespace roomtex
