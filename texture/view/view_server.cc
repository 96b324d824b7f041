#include "texture/view/view_server.h"

#include "view_page.h"

namespace roomtex {

ViewServer::ViewServer(ViewContent content, LocalServer* server, int num_threads)
    : answers_(std::move(content), num_threads, [server] { return server->stopping(); }) {
  AddPage(kViewPage, server);
  for (const auto& [word, answer] : answers_.json()) server->AddJson("/" + word, answer);
  for (const auto& [word, answer] : answers_.content()) server->AddContent("/" + word, answer);
}

}  // namespace roomtex
