#pragma once
// JSON that somebody else may have written: files beside models, requests of a page. Nested no
// deeper than 64 levels, since copying or writing what is deeper uses up the stack.

#include <string>

#include "core/report.h"

namespace roomtex {

// Throws InputError, with the byte where it is known, for what is no JSON; path: its name in
// messages.
Json ParseJson(const std::string& text, const std::string& path, const std::string& remedy);
// The same of a file, of 256 MiB at most. Throws InputError, also where there is none.
Json ReadJson(const std::string& path, const std::string& remedy);
// null where there is no such file, or none that is JSON.
Json ReadJsonIfAny(const std::string& path);

}  // namespace roomtex
