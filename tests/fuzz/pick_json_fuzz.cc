// Any bytes as what the picker's page sends (PUT picks): an InputError or a UsageError, or picks
// that lie in a photo and have finite points; never a crash.

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <opencv2/imgcodecs.hpp>

#include "align/pick/pick_json.h"
#include "core/error.h"
#include "core/json_text.h"
#include "core/partial_path.h"

namespace {

// One photo and one scan of six by four samples, one of them missing.
const roomtex::PickScene& Scene() {
  static const roomtex::PickScene* const scene = [] {
    const roomtex::PartialFolder folder(std::filesystem::temp_directory_path().string());
    std::filesystem::create_directory(folder / "images");
    cv::imwrite(folder / "images/a.png", cv::Mat(48, 64, CV_8UC3, cv::Scalar(90, 90, 90)));
    std::ofstream ptx(folder / "scan.ptx");
    ptx << "6\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    for (int column = 0; column < 6; ++column) {
      for (int row = 0; row < 4; ++row) {
        const bool missing = column == 2 && row == 2;
        ptx << (missing ? 0 : 0.1 * column) << (missing ? " 0 " : " 2 ")
            << (missing ? 0 : 0.1 * row) << " 0.5\n";
      }
    }
    ptx.close();
    roomtex::PickSceneInput input;
    input.image_path = folder / "images";
    input.camera.camera_params = "60,32,24,0";
    input.scan_paths = {folder / "scan.ptx"};
    roomtex::Progress progress(true);
    return new roomtex::PickScene(input, &progress);
  }();
  return *scene;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const roomtex::PutPicks put =
        roomtex::ParsePutPicks(roomtex::ParseJson(text, "request", ""), Scene());
    if (put.revision < 0) std::abort();
    for (const roomtex::SessionPick& pick : put.picks) {
      if (Scene().FindPhoto(pick.image_name) == nullptr || !(pick.weight >= 0)) std::abort();
      if (pick.x_in_img && !pick.x_in_img->allFinite()) std::abort();
      if (pick.x_in_scan && !pick.x_in_scan->allFinite()) std::abort();
      if (!pick.x_in_img && !pick.x_in_scan) std::abort();
    }
  } catch (const roomtex::InputError&) {
  } catch (const roomtex::UsageError&) {
  }
  return 0;
}
