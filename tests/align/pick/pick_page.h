#pragma once
// The server of roomtex-pick on the room of pick_room.h, asked as its page asks.

#include <memory>
#include <string>

#include <gmock/gmock.h>

#include "align/pick/pick_json.h"
#include "align/pick/pick_server.h"
#include "tests/align/pick/pick_room.h"
#include "tests/support/temp_folder.h"

// After Eigen: what it includes defines a macro _res, a name that Eigen uses.
#include <httplib.h>

namespace roomtex {

class PickPage : public testing::Test {
 protected:
  void SetUp() override { Serve(); }

  // Begins, or ends and begins again, as a user who starts the command once more.
  void Serve(const std::string& image_name = "", const std::string& align_program = "true") {
    server_.reset();
    session_ = std::make_unique<PickSession>(ThePickRoom().scene(), picks_path_);
    PickServer::Setup setup;
    setup.server.port = 0;
    setup.image_name = image_name;
    setup.aligned_path = folder_ / "aligned";
    setup.align_program = align_program;
    const Page page = {{"index.html", "<p>page</p>"}, {"pick.js", "1"}};
    server_ = std::make_unique<PickServer>(ThePickRoom().scene(), session_.get(), page, setup);
    server_->Start(false);
    const std::string url = server_->server().Url();
    base_ = url.substr(url.find('/', 7));
    origin_ = "http://127.0.0.1:" + std::to_string(server_->server().port());
  }

  struct Answer {
    int status = -1;
    std::string body, type;
    Json json() const { return Json::parse(body, nullptr, false); }
  };
  Answer From(const httplib::Result& result) const {
    if (!result) return {};
    return {result->status, result->body, result->get_header_value("Content-Type")};
  }
  Answer Get(const std::string& path) const { return From(Client().Get(base_ + path)); }
  Answer Send(const std::string& method, const std::string& path, const std::string& body) const {
    const httplib::Headers headers = {{"Origin", origin_}};
    httplib::Client client = Client();
    if (method == "PUT") {
      return From(client.Put(base_ + path, headers, body, "application/json"));
    }
    if (method == "DELETE") {
      return From(client.Delete(base_ + path, headers, body, "application/json"));
    }
    return From(client.Post(base_ + path, headers, body, "application/json"));
  }
  Answer Put(int revision, const Json& picks) const {
    return Send("PUT", "picks", Json{{"revision", revision}, {"picks", picks}}.dump());
  }
  Answer Post(const std::string& path) const { return Send("POST", path, "{}"); }

  // As the page sends a pick: with its point, or (fresh) with its place alone.
  static Json ToJson(const SessionPick& pick, bool fresh = false) {
    Json json;
    json["image_name"] = pick.image_name;
    if (pick.x_in_img) json["img"] = {pick.x_in_img->x(), pick.x_in_img->y()};
    if (pick.spot) {
      json["scan"] = {
          {"id", pick.spot->scan}, {"x", pick.spot->place.x()}, {"y", pick.spot->place.y()}};
    }
    if (pick.x_in_scan && !fresh) {
      json["point"] = {pick.x_in_scan->x(), pick.x_in_scan->y(), pick.x_in_scan->z()};
    }
    json["weight"] = pick.weight;
    return json;
  }
  static Json ToJson(const std::vector<SessionPick>& picks, bool fresh = false) {
    Json json = Json::array();
    for (const SessionPick& pick : picks) json.push_back(ToJson(pick, fresh));
    return json;
  }
  static std::vector<SessionPick> TruePicks(size_t count) {
    return ThePickRoom().SmoothPicks(ThePickRoom().clicked_photo(), count);
  }
  static std::string ClickedName() {
    return ThePickRoom().room().PhotoName(ThePickRoom().clicked_photo());
  }

  const TempFolder folder_;
  const std::string picks_path_ = folder_ / "picks.csv";
  std::unique_ptr<PickSession> session_;
  std::unique_ptr<PickServer> server_;
  std::string base_, origin_;

 private:
  httplib::Client Client() const {
    httplib::Client client("127.0.0.1", server_->server().port());
    client.set_read_timeout(60);
    return client;
  }
};

}  // namespace roomtex
