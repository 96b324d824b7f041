#pragma once
// The user's browser on an address that is secret.

#include <string>

namespace roomtex {

// Opens `url` in the user's browser (xdg-open). The process list, which everyone on the machine may
// read, shows only the name of a page that leads there: a file that nobody but the user can read.
// The page is removed again with this object, so keep it as long as the address is good.
class OpenBrowser {
 public:
  explicit OpenBrowser(const std::string& url);
  ~OpenBrowser();
  OpenBrowser(const OpenBrowser&) = delete;
  OpenBrowser& operator=(const OpenBrowser&) = delete;

  // "" or why no browser could be started, a sentence for a warning.
  const std::string& problem() const { return problem_; }

 private:
  std::string folder_, problem_;
};

}  // namespace roomtex
