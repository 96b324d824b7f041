#pragma once
// What every command with a page says once its server answers.

#include <memory>

#include "core/command_line.h"
#include "core/local_server.h"
#include "core/open_browser.h"

namespace roomtex {

// Prints the address and how other computers reach it, warns that nothing is encrypted where they
// are let in, and opens the browser if that is asked for: keep what is given as long as the server
// answers.
std::unique_ptr<OpenBrowser> AnnouncePage(const LocalServerOptions& options,
                                          const LocalServer& server,
                                          const Command::Context& context);

}  // namespace roomtex
