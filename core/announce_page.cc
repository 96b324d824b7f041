#include "core/announce_page.h"

#include <iostream>
#include <string>

namespace roomtex {
namespace {

constexpr char kNotEncrypted[] =
    "other computers are let in, and nothing is encrypted: who listens on the network sees the "
    "photos and the address with its token, and may use it. Prefer ssh -L, as the line below "
    "the address says";

}  // namespace

std::unique_ptr<OpenBrowser> AnnouncePage(const LocalServerOptions& options,
                                          const LocalServer& server,
                                          const Command::Context& context) {
  if (options.port != 0 && server.port() != options.port) {
    context.progress.Note("port " + std::to_string(options.port) + " is taken: using " +
                          std::to_string(server.port()));
  }
  if (options.allow_remote) context.Warn(kNotEncrypted);
  std::cout << server.Url() << "\n" << server.SshLine() << std::endl;
  if (!options.open) return nullptr;
  auto browser = std::make_unique<OpenBrowser>(server.Url());
  if (!browser->problem().empty()) context.Warn(browser->problem());
  return browser;
}

}  // namespace roomtex
