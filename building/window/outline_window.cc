#include "building/window/outline_window.h"

#include "building/window/outline_session.h"
#include "core/announce_page.h"

namespace roomtex {

OutlineProposal RunOutlineWindow(const OutlineWindowInput& input, OutlineCloud cloud,
                                 std::vector<PlaneSegment> segments,
                                 const Command::Context& context) {
  context.progress.Stage("prepare");
  OutlineSession session(input, std::move(cloud), std::move(segments));
  for (const std::string& sentence : session.left_out()) {
    context.Warn("left out of the page, and of what it saves: " + sentence);
  }
  using Query = LocalServer::Query;
  LocalServer server(input.server);
  AddPage(input.page, &server);
  server.AddJson("/state", [&](const Query&) { return session.State(); });
  server.AddContent("/points", [&](const Query&) {
    return LocalServer::Content{std::make_shared<const std::string>(session.Points()),
                                "application/octet-stream", "", false};
  });
  server.AddPut("/buildings", [&](const Json& json) { return session.Put(json); });
  server.AddPost("/propose", [&](const Json& json) { return session.Propose(json); });
  server.AddPost("/heights", [&](const Json& json) { return session.Heights(json); });
  server.AddPost("/up", [&](const Json& json) { return session.SetUp(json); });
  server.AddPost("/models", [&](const Json&) { return session.WriteModels(); });
  server.Start(true);
  context.progress.Finish();
  const auto browser = AnnouncePage(input.server, server, context);
  context.progress.Note("Ctrl-C ends");
  server.Wait();
  return session.Judged();
}

}  // namespace roomtex
