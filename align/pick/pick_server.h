#pragma once
// Serves the page of roomtex-pick: the paths of align/pick/README.md.

#include <array>
#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "align/pick/align_job.h"
#include "align/pick/back_projection.h"
#include "align/pick/photo_sights.h"
#include "align/pick/pick_scene.h"
#include "align/pick/pick_session.h"
#include "core/child_program.h"
#include "core/image_tiles.h"
#include "core/local_server.h"
#include "core/page.h"

namespace roomtex {

class PickServer {
 public:
  struct Setup {
    LocalServerOptions server;
    std::string image_name;    // the photo to begin with; "" = choose
    std::string aligned_path;  // where roomtex-align writes
    std::string next_token;    // of the server that follows when the page asks for the mirror image
    std::string align_program = BesideThisProgram("roomtex-align");
  };

  // scene and session must outlive it.
  PickServer(const PickScene& scene, PickSession* session, const Page& page, const Setup& setup);
  ~PickServer();

  // As LocalServer.
  void Start(bool stop_on_signals) { server_.Start(stop_on_signals); }
  void Wait();
  // The page wants the scans the other way round (mirror_picks.h): the server has stopped for that.
  bool mirror_asked() const { return mirror_asked_; }
  const LocalServer& server() const { return server_; }

 private:
  using Query = LocalServer::Query;
  using Content = LocalServer::Content;
  void AddPictures();
  void AddAlign();
  // Of a run of roomtex-align: what it has found is shown. A sentence where it cannot be.
  std::string TakeReport(const std::string& folder, const Json& report);
  Json State();
  Json Photos(const PickSession::Snapshot& snapshot);
  std::optional<Content> Tile(const Query& query);
  std::optional<Content> BackTile(const Query& query, int photo_id);
  Json Edges(const Query& query);
  std::optional<Content> Overlay(const Query& query);
  // The solution of this number; null if that is no longer the session's, or does not place the
  // photo.
  std::shared_ptr<const PickSession::Snapshot> Solved(const PickPhoto& photo, int solution);
  std::optional<Content> Thumbnail(const Query& query);
  Json ScanPoint(const Query& query) const;
  Json Corner(const Query& query);
  int SelectedPhoto() const;

  const PickScene& scene_;
  PickSession* const session_;
  const Setup setup_;
  std::vector<std::vector<std::string>> pictures_;  // of each scan
  std::vector<std::array<int, 4>> content_;         // of each scan's picture
  ImageTiles tiles_;
  std::mutex thumbnails_mutex_;  // one is made at a time: tiles are more urgent
  std::map<int, std::shared_ptr<const std::string>> thumbnails_;
  // The photo in which a corner was looked for last, grey.
  std::mutex corner_mutex_;
  int corner_photo_id_ = -1;
  cv::Mat1b corner_photo_;
  BackProjections back_projections_;
  PhotoSights sights_;
  AlignJob align_;
  std::atomic<bool> mirror_asked_{false};
  LocalServer server_;  // last: its threads use the rest
};

}  // namespace roomtex
