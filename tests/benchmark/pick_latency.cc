// How long the page of roomtex-pick has to wait, on 3 M samples and photos of 20 MP:
//   pick_latency [FOLDER]    (a folder keeps the simulated capture for the next run)

#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "align/clicks/picks.h"
#include "capture/simulation/simulated_room.h"
#include "core/report.h"
#include "core/statistics.h"
#include "importers/scan_writer.h"

// After Eigen: what it includes defines a macro _res, a name that Eigen uses.
#include <httplib.h>

namespace roomtex {
namespace {

constexpr int kRepeats = 11;

double Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string ReadText(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void MakeCapture(const std::string& folder) {
  SimulatedRoomOptions options;
  options.num_photos = 30;
  options.photo_width = 5472;
  options.photo_height = 3648;
  options.scan_columns = 2450;
  options.scan_rows = 1225;
  const SimulatedRoom room(options);
  std::filesystem::create_directories(folder + "/images");
  const int clicked = room.BestPhotoForPicks();
  // Rendering is slow; to the server every photo of this size is alike.
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const std::string path = folder + "/images/" + room.PhotoName(photo);
    if (photo == clicked) cv::imwrite(path, room.RenderPhoto(photo));
  }
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    if (photo == clicked) continue;
    std::filesystem::copy_file(folder + "/images/" + room.PhotoName(clicked),
                               folder + "/images/" + room.PhotoName(photo));
  }
  WriteSparseModel(room.MakeSparseModel(40000, 0.7), folder + "/sparse");
  WriteScan(room.MakeScan(0), {}, folder + "/room.rtpi");
  std::vector<Pick> picks;
  for (const SimulatedPick& pick : room.MakePicks(clicked, 6)) {
    picks.push_back({pick.image_name, pick.x_in_img, pick.x_in_scan});
  }
  WritePicks(folder + "/true_picks.csv", picks);
}

class Server {
 public:
  Server(const std::string& bin, const std::string& folder) : folder_(folder) {
    std::filesystem::remove(folder + "/picks.csv");
    std::filesystem::copy_file(folder + "/true_picks.csv", folder + "/picks.csv");
    std::filesystem::remove(folder + "/out");
    start_ = Seconds();
    pid_ = fork();
    if (pid_ == 0) {
      if (freopen((folder + "/out").c_str(), "w", stdout) == nullptr) _exit(1);
      const std::string program = bin + "/roomtex-pick";
      execl(program.c_str(), program.c_str(), "--quiet", "--port", "0", "--input_path",
            (folder + "/sparse").c_str(), "--image_path", (folder + "/images").c_str(),
            "--scan_path", (folder + "/room.rtpi").c_str(), "--output_path",
            (folder + "/picks.csv").c_str(), nullptr);
      _exit(1);
    }
    std::string text;
    while (text.find('\n') == std::string::npos) {
      usleep(2000);
      text = ReadText(folder + "/out");
    }
    url_ = text.substr(0, text.find('\n'));
    base_ = url_.substr(url_.find('/', 7));
    host_ = url_.substr(0, url_.find('/', 7));
    client_ = std::make_unique<httplib::Client>(host_);
    client_->set_read_timeout(120);
    client_->set_keep_alive(true);
    client_->set_tcp_nodelay(true);
  }
  ~Server() {
    kill(pid_, SIGINT);
    int status = 0;
    rusage usage{};
    wait4(pid_, &status, 0, &usage);
    std::printf("%-58s %8.0f MB\n", "peak memory of the command", usage.ru_maxrss / 1024.0);
    std::printf("%-58s %8d\n", "exit code after Ctrl-C", WEXITSTATUS(status));
  }
  double start() const { return start_; }

  std::string Get(const std::string& path) {
    const auto answer = client_->Get(base_ + path);
    if (!answer || answer->status != 200) std::printf("GET %s failed\n", path.c_str());
    return answer ? answer->body : "";
  }
  Json Put(const Json& json) {
    const auto answer = client_->Put(base_ + "picks", httplib::Headers{{"Origin", host_}},
                                     json.dump(), "application/json");
    if (!answer || answer->status != 200) std::printf("PUT failed\n");
    return answer ? Json::parse(answer->body, nullptr, false) : Json();
  }

 private:
  std::string folder_, url_, base_, host_;
  double start_ = 0;
  pid_t pid_ = 0;
  std::unique_ptr<httplib::Client> client_;
};

void Say(const std::string& what, double seconds) {
  std::printf("%-58s %8.0f ms\n", what.c_str(), 1000 * seconds);
}

// Repeated changes of the picks: median of what the browser waits, and of what the server says.
void TimePuts(const std::string& what, Server* server, Json session, int wrong_px) {
  std::vector<double> waits, own;
  const double x = session["picks"][0]["img"][0];
  for (int i = 0; i < kRepeats; ++i) {
    session["picks"][0]["img"][0] = x + 0.1 * i + wrong_px;  // dragged
    const double start = Seconds();
    session = server->Put({{"revision", session["revision"]}, {"picks", session["picks"]}});
    waits.push_back(Seconds() - start);
    own.push_back(session["milliseconds"].get<double>() / 1000);
  }
  Say(what + ", as the browser waits", Median(waits));
  Say(what + ", the server's own computing", Median(own));
}

void Measure(const std::string& bin, const std::string& folder) {
  Server server(bin, folder);
  Say("start to the URL", Seconds() - server.start());
  server.Get("");
  Json state = Json::parse(server.Get("state"));
  Say("start to the first state", Seconds() - server.start());
  const std::string photo = std::to_string(state["selected_photo"].get<int>());
  double start = Seconds();
  server.Get("tile?photo=" + photo + "&level=3&x=0&y=0");
  Say("first tile of a photo", Seconds() - start);
  start = Seconds();
  server.Get("tile?photo=" + photo + "&level=0&x=3&y=2");
  Say("another tile of it", Seconds() - start);
  start = Seconds();
  server.Get("tile?scan=0&picture=intensity&level=2&x=0&y=0");
  Say("first tile of the scan", Seconds() - start);
  Say("start to photo and scan on the page", Seconds() - server.start());
  start = Seconds();
  server.Get("thumbnail?photo=" + photo);
  Say("thumbnail", Seconds() - start);
  while (!state["ready"]) {
    usleep(20000);
    state = Json::parse(server.Get("state"));
  }
  Say("start until the ray caster stands (background)", Seconds() - server.start());
  start = Seconds();
  for (const char* name : {"local", "shaded"}) {
    server.Get("tile?scan=0&picture=" + std::string(name) + "&level=2&x=0&y=0");
  }
  Say("first tiles of the two other pictures of the scan", Seconds() - start);
  start = Seconds();
  const std::string revision = std::to_string(state["session"]["revision"].get<int>());
  server.Get("edges?photo=" + photo + "&revision=" + revision);
  Say("edges, with waiting until they are found", Seconds() - start);
  start = Seconds();
  server.Get("tile?back=" + photo + "&scan=0&revision=" + revision + "&level=2&x=0&y=0");
  Say("first tile of the back-projection", Seconds() - start);
  TimePuts("six picks", &server, state["session"], 0);
  Json session = Json::parse(server.Get("state"))["session"];
  TimePuts("six picks, one of them wrong", &server, session, 80);
  session = Json::parse(server.Get("state"))["session"];
  session["picks"].erase(3);
  session["picks"].erase(3);
  session["picks"].erase(3);
  session = server.Put({{"revision", session["revision"]}, {"picks", session["picks"]}});
  TimePuts("three picks", &server, session, -80);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  const std::string bin = std::filesystem::canonical("/proc/self/exe").parent_path();
  std::string folder = argc > 1 ? argv[1] : "";
  const bool keep = !folder.empty();
  if (!keep) {
    folder = (std::filesystem::temp_directory_path() / "roomtex-pick-latency-XXXXXX").string();
    if (mkdtemp(folder.data()) == nullptr) return 1;
  }
  if (!std::filesystem::exists(folder + "/true_picks.csv")) roomtex::MakeCapture(folder);
  roomtex::Measure(bin, folder);
  if (!keep) std::filesystem::remove_all(folder);
}
