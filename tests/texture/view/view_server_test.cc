// What the page asks for, by the paths of view_server.h.

#include "texture/view/view_server.h"

#include <cstring>

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/view/view_scene.h"

// After Eigen, see tests/core/served_page.h.
#include <httplib.h>

namespace roomtex {
namespace {

class ServedView : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    WriteViewFolder(TwoWallsScan(300, 300), folder_->path());
    ViewContent content;
    content.model = ReadViewModel(folder_->path());
    content.evidence_path = *folder_ / "evidence.ply";
    content.warnings = {"A sentence."};
    LocalServerOptions options;
    options.port = 0;
    server_ = new LocalServer(options);
    view_ = new ViewServer(std::move(content), server_, 2);
    server_->Start(false);
    const std::string url = server_->Url();
    base_ = url.substr(url.find('/', 7));
  }
  static void TearDownTestSuite() {
    server_->RequestStop();
    server_->Wait();
    delete view_;
    delete server_;
    delete folder_;
  }

  static httplib::Result Get(const std::string& path) {
    httplib::Client client("127.0.0.1", server_->port());
    client.set_read_timeout(20);
    return client.Get(base_ + path);
  }
  static Json GetJson(const std::string& path) {
    const auto answer = Get(path);
    EXPECT_TRUE(answer) << path;
    EXPECT_EQ(answer->status, 200) << path << answer->body;
    return Json::parse(answer->body);
  }
  static int Status(const std::string& path) {
    const auto answer = Get(path);
    return answer ? answer->status : -1;
  }

  static inline TempFolder* folder_ = nullptr;
  static inline LocalServer* server_ = nullptr;
  static inline ViewServer* view_ = nullptr;
  static inline std::string base_;
};

TEST_F(ServedView, HasItsPage) {
  const auto page = Get("");
  ASSERT_TRUE(page);
  EXPECT_THAT(page->body, testing::HasSubstr("view.js"));
  EXPECT_GT(Get("view.js")->body.size(), 100000u);
  EXPECT_EQ(Get("view.css")->get_header_value("Content-Type"), "text/css; charset=utf-8");
}

TEST_F(ServedView, DescribesTheScene) {
  const Json scene = GetJson("scene");
  EXPECT_EQ(scene["num_vertices"], 90000);
  EXPECT_NEAR(scene["pages"][0]["width"].get<int>(), 300, 1);
  EXPECT_EQ(scene["up"], Json({0.0, 1.0, 0.0}));
  EXPECT_EQ(scene["num_cameras"], 0);
  EXPECT_EQ(scene["warnings"][0], "A sentence.");
  size_t sum = 0;
  for (const Json& chunk : scene["chunks"]) sum += chunk["num_triangles"].get<size_t>();
  EXPECT_EQ(sum, scene["num_triangles"].get<size_t>());
  EXPECT_NEAR(scene["bounds"]["min"][2].get<double>(), -4, 1e-4);
}

TEST_F(ServedView, ChunksHaveTheSizeThatTheirHeaderSays) {
  const Json scene = GetJson("scene");
  for (const Json& chunk : scene["chunks"]) {
    size_t last = 0;
    for (const int level : {0, 1, 2}) {
      const std::string query = "?id=" + chunk["id"].dump() + "&level=" + std::to_string(level);
      const auto answer = Get("chunk" + query);
      ASSERT_EQ(answer->status, 200);
      uint32_t header[4];
      std::memcpy(header, answer->body.data(), 16);
      EXPECT_EQ(answer->body.size(), 16 + 20 * header[1] + 2 * header[2]);
      EXPECT_GT(header[2], last);
      last = header[2];
      EXPECT_EQ(Get("evidence_chunk" + query)->body.size(), 4 * header[1]);
    }
    EXPECT_EQ(last, 3 * chunk["num_triangles"].get<size_t>());
  }
}

TEST_F(ServedView, TexturesAreScaledToWhatIsAskedFor) {
  const auto whole = Get("texture?page=0&max=4096"), small = Get("texture?page=0&max=100");
  EXPECT_EQ(whole->get_header_value("Content-Type"), "image/png");
  const auto decode = [](const std::string& bytes) {
    return cv::imdecode(
        cv::Mat(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data())), 1);
  };
  const cv::Mat image = decode(whole->body);
  ASSERT_EQ(image.cols, GetJson("scene")["pages"][0]["width"].get<int>());
  EXPECT_EQ(image.at<cv::Vec3b>(20, 10), cv::Vec3b(77, 20, 10));
  EXPECT_EQ(decode(small->body).cols, 100);
  EXPECT_EQ(Status("texture?page=1&max=100"), 404);
}

TEST_F(ServedView, DescribesTheEvidence) {
  const Json evidence = GetJson("evidence");
  EXPECT_EQ(evidence["available"], true);
  EXPECT_EQ(evidence["max_views"], 3);
  EXPECT_NEAR(evidence["disagreement_high"].get<double>(), 19, 1);
}

TEST_F(ServedView, RefusesWhatMakesNoSense) {
  for (const char* path :
       {"chunk", "chunk?id=0", "chunk?id=-1&level=0", "chunk?id=999&level=0", "chunk?id=0&level=3",
        "chunk?id=x&level=0", "evidence_chunk?id=999&level=0", "photo?id=0&max=100", "lattice?id=0",
        "texture?page=0"}) {
    const auto answer = Get(path);
    ASSERT_TRUE(answer) << path;
    EXPECT_EQ(answer->status, 422) << path;
    EXPECT_FALSE(Json::parse(answer->body)["error"].get<std::string>().empty()) << path;
  }
  EXPECT_EQ(Status("model.glb"), 404);
  EXPECT_EQ(Status("../../etc/passwd"), 404);
}

TEST_F(ServedView, HasNoCamerasWithoutAModel) {
  EXPECT_EQ(GetJson("cameras"), Json::array());
  EXPECT_EQ(Get("points")->body, "");
}

}  // namespace
}  // namespace roomtex
