#pragma once
// roomtex-view's page and what it asks for, served.

#include "core/local_server.h"
#include "texture/view/view_answers.h"

namespace roomtex {

// Adds the page, and a path (GET) for every word of ViewAnswers. The server must outlive this, and
// be stopped before this ends.
class ViewServer {
 public:
  ViewServer(ViewContent content, LocalServer* server, int num_threads);

 private:
  ViewAnswers answers_;
};

}  // namespace roomtex
