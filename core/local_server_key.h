#pragma once
// The secret of an address that outlives the server: links into a page stay good as long as it
// serves the same folder.

#include <string>

namespace roomtex {

// The token for what is served from `path`, the same at each call: kept in a file that only its
// owner reads, $XDG_STATE_HOME/roomtex/keys (~/.local/state by default), and never beside the data,
// where others may read. "" if it cannot be kept: then the server makes a new one.
std::string KeptToken(const std::string& path);

// 160 random bits, as 40 digits.
std::string MakeToken();

}  // namespace roomtex
