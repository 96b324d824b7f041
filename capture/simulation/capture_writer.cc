#include "capture/simulation/capture_writer.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <sstream>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include "capture/simulation/simulated_projector.h"
#include "capture/simulation/true_colors.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_text.h"
#include "core/csv.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/partial_path.h"
#include "core/photo.h"
#include "core/result_names.h"
#include "core/text.h"
#include "core/twist.h"
#include "importers/rtpi.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

constexpr int kJpegQuality = 95;
constexpr double kAperture = 8, kIso = 400;

void WriteText(const std::string& path, const std::string& text) {
  OutputFile file(path);
  file.stream() << text;
  file.Commit();
}

std::string ScanName(int station) {
  return station == 0 ? "scan.rtpi" : "scan_" + std::to_string(station) + ".rtpi";
}

std::string SimilarRoomPhotoName(const SimulatedRoom& room, int i) {
  return room.PhotoName(room.NumPhotos() + i);
}

void RequireNoOtherPhotos(const SimulatedRoom& room, const std::string& photo_folder) {
  std::set<std::string> names;
  const int count = room.NumPhotos() + room.options().similar_room;
  for (int i = 0; i < count; ++i) names.insert(room.PhotoName(i));
  RemoveLeftovers(photo_folder);
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(photo_folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".jpg" && names.count(name) == 0) {
      throw InputError(photo_folder, "", "holds " + name + ", which is not of this capture",
                       "Give another --output_path, or remove the folder first");
    }
  }
}

constexpr int kSecondsPerPlace = 20;

// Seconds from the first photo on. With projectors a place every minute, its plain photo 7 seconds
// later.
int TimeOf(const SimulatedRoom& room, int photo) {
  const int place = room.PlaceOf(photo);
  if (room.Projectors().empty()) return kSecondsPerPlace * place;
  return 60 * place + (room.IsPatterned(photo) ? 0 : 7);
}

// From noon on; the days of May are enough for all that can be simulated.
std::string DateTime(int seconds) {
  const int hours = 12 + seconds / 3600;
  return fmt::format("2008:05:{:02} {:02}:{:02}:{:02}", 1 + hours / 24, hours % 24,
                     seconds / 60 % 60, seconds % 60);
}

// seconds: TimeOf() the photo.
void WritePhoto(const SimulatedRoom& room, int photo, int seconds, const std::string& path) {
  const cv::Mat image = room.RenderPhoto(photo);
  std::vector<uchar> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  OutputFile file(path);
  file.stream().write(reinterpret_cast<const char*>(bytes.data()),
                      static_cast<std::streamsize>(bytes.size()));
  file.stream().flush();
  if (room.options().exif) {
    ExposureData exposure;
    exposure.exposure_time = room.NotedTime(photo);
    exposure.f_number = kAperture;
    exposure.iso = kIso;
    exposure.camera = "roomtex simulated camera";
    exposure.date_time = DateTime(seconds);
    WriteExposureData(file.partial_path(), exposure);
  }
  const Camera& camera = room.TrueCamera(photo);
  if (room.options().exif_lens && !camera.IsPanorama()) {
    WriteFocalLength(file.partial_path(), camera.MeanFocalLength(), {camera.width, camera.height});
  }
  file.Commit();
}

// Photos of another room in the folder of the first (SimulatedRoomOptions::similar_room), taken
// after its own.
void WriteSimilarRoom(const SimulatedRoom& room, const std::string& photo_folder,
                      Progress* progress) {
  const int count = room.options().similar_room;
  if (count == 0) return;
  SimulatedRoomOptions options = room.options();
  options.similar_room = 0;
  options.furniture_seed = options.random_seed + 1;
  // Other places than those of the first room.
  options.num_photos = std::max(options.num_photos + 3, count);
  const SimulatedRoom other(options);
  for (int i = 0; i < count; ++i) {
    // Spread over the places: each looks somewhere else.
    const int photo = (2 * i + 1) * other.NumPhotos() / (2 * count);
    WritePhoto(other, photo, kSecondsPerPlace * (room.NumPhotos() + i),
               photo_folder + "/" + SimilarRoomPhotoName(room, i));
    progress->Tick();
  }
}

std::string PoseLine(const Rigid& pose) {
  const Eigen::Vector4d q = WxyzFromQuaternion(pose.rotation);
  const Eigen::Vector3d& t = pose.translation;
  return fmt::format("{:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}", q[0], q[1], q[2],
                     q[3], t.x(), t.y(), t.z());
}

// As the scanner itself measured it: RTPI knows no pose.
Scan InItsStation(Scan scan) {
  const Rigid station_from_scan = scan.scan_from_station.Inverse();
  for (Eigen::Vector3d& point : scan.points) point = station_from_scan * point;
  scan.scan_from_station = Rigid();
  return scan;
}

void WriteScans(const SimulatedRoom& room, const std::string& folder, CaptureSummary* summary,
                Progress* progress) {
  progress->Stage("scans", room.NumStations());
  std::string poses = "# scan_from_station: NAME qw qx qy qz tx ty tz, metres\n";
  for (int station = 0; station < room.NumStations(); ++station) {
    const Scan scan = room.MakeScan(station);
    WriteRtpi(RtpiFromScan(InItsStation(scan)), folder + "/" + ScanName(station));
    poses += ScanName(station) + " " + PoseLine(scan.scan_from_station) + "\n";
    summary->num_samples += scan.points.size();
    summary->num_missing += scan.NumMissing();
    progress->Tick();
  }
  if (room.NumStations() > 1) WriteText(folder + "/scan_poses.txt", poses);
}

// Into `path`, on the scan of a station.
void WritePicks(const SimulatedRoom& room, int station, const std::string& path,
                CaptureSummary* summary) {
  std::string text =
      "# pixel in the photo (centre of the upper-left pixel = 0.5, 0.5), point in the scan frame "
      "in "
      "metres\n" +
      CsvLine({"image_name", "x", "y", "scan_x", "scan_y", "scan_z"});
  if (room.options().num_picks > 0) {
    const int photo = room.BestPhotoForPicks(station);
    for (const SimulatedPick& pick : room.MakePicks(photo, room.options().num_picks, station)) {
      if (station == 0) {
        summary->picked_photo = pick.image_name;
        ++summary->num_picks;
      }
      std::vector<std::string> fields = {pick.image_name};
      for (const double x : pick.x_in_img) fields.push_back(Number(x, 2));
      for (const double x : pick.x_in_scan) fields.push_back(Number(x, 4));
      text += CsvLine(fields);
    }
  }
  WriteText(path, text);
}

void WriteCamera(const Camera& camera, const std::string& folder) {
  WriteText(folder + "/cameras.txt",
            "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n" + CamerasTextLine(camera));
  WriteText(folder + "/" + kCameraOptionsName, FeatureExtractorOptions(camera) + "\n");
}

// What roomtex-associate has to find, and what the projectors throw from where.
void WriteProjectors(const SimulatedRoom& room, const std::string& folder) {
  if (room.Projectors().empty()) return;
  std::string pairs = CsvLine({"patterned_image", "plain_image"});
  for (int photo = 0; photo < room.NumPhotos(); photo += 2) {
    pairs += CsvLine({room.PhotoName(photo), room.PhotoName(photo + 1)});
  }
  WriteText(folder + "/associations.csv", pairs);
  const Rigid room_from_scan = room.ScanFromRoom().Inverse();
  std::string text = "# proj_from_scan: PATTERN WIDTH HEIGHT fx fy cx cy qw qx qy qz tx ty tz\n";
  for (const Projector& projector : room.Projectors()) {
    const Camera& camera = projector.camera();
    const std::string name = "pattern_" + std::to_string(camera.camera_id) + ".png";
    text += fmt::format("{} {} {}", name, camera.width, camera.height);
    for (const double param : camera.params) text += " " + Exact(param);
    text += " " + PoseLine(projector.proj_from_room() * room_from_scan) + "\n";
    std::vector<uchar> bytes;
    cv::imencode(".png", projector.pattern(), bytes);
    WriteText(folder + "/" + name, std::string(bytes.begin(), bytes.end()));
  }
  WriteText(folder + "/projectors.txt", text);
}

// The motion of each camera while its photo was read.
void WriteMotion(const SimulatedRoom& room, const std::string& folder) {
  if (room.options().rolling_shutter_ms == 0) return;
  std::string text = "# from the first row to the last one, in the camera's frame\n" +
                     CsvLine({"image_name", "turn_x_deg", "turn_y_deg", "turn_z_deg", "move_x",
                              "move_y", "move_z"});
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const Rigid last_from_first =
        room.CamFromRoomAt(photo, 0.5) * room.CamFromRoomAt(photo, -0.5).Inverse();
    const Eigen::Vector3d turn = VectorFromRotation(last_from_first.rotation);
    std::vector<std::string> fields = {room.PhotoName(photo)};
    for (const double x : turn) fields.push_back(Exact(DegFromRad(x)));
    for (const double x : last_from_first.translation) fields.push_back(Exact(x));
    text += CsvLine(fields);
  }
  WriteText(folder + "/rolling_shutter.csv", text);
}

void WriteTruth(const SimulatedRoom& room, const std::string& folder) {
  SparseModel model;
  std::string exposures =
      CsvLine({"image_name", "exposure_ev", "exposure_time", "red_gain", "blue_gain"});
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    SparseImage& image = model.images[photo + 1];
    image.image_id = photo + 1;
    image.camera_id = room.TrueCamera(photo).camera_id;
    model.cameras[image.camera_id] = room.TrueCamera(photo);
    image.name = room.PhotoName(photo);
    image.cam_from_model = room.CamFromScan(photo);
    exposures +=
        CsvLine({image.name, Exact(room.ExposureEv(photo)), Exact(room.ExposureTime(photo)),
                 Exact(room.WhiteBalance(photo)[0]), Exact(room.WhiteBalance(photo)[2])});
  }
  WriteSparseModelText(model, folder);
  WriteText(folder + "/exposures.csv", exposures);
  WriteProjectors(room, folder);
  WriteMotion(room, folder);
  const Rigid scan_from_room = room.ScanFromRoom();
  WriteSimilarity(folder + "/scan_from_room.txt",
                  {1, scan_from_room.rotation, scan_from_room.translation});
}

// COLMAP before 4.1 gets faces of the panoramas; picks and colours are those of the panoramas.
std::string CommandsForPanoramas(const std::string& scans) {
  return "export QT_QPA_PLATFORM=offscreen\n"
         "roomtex-import --input_path photos --output_path faces\n"
         "colmap feature_extractor --database_path database.db --image_path faces "
         "--SiftExtraction.use_gpu 0 $(cat faces/camera_options.txt)\n"
         "colmap exhaustive_matcher --database_path database.db --SiftMatching.use_gpu 0\n"
         "roomtex-mapper --database_path database.db --image_path faces --output_path sparse\n"
         "roomtex-align --input_path sparse/0 --panoramas_path faces/panoramas.json --image_path "
         "photos" +
         scans +
         " --picks_path picks.csv --output_path aligned\n"
         "roomtex-texture --input_path aligned --image_path photos" +
         scans + " --output_path textured\n";
}

std::string CommandsToType(bool paired, const std::string& scans) {
  // The photos for COLMAP and those for the colours.
  const std::string mapped = paired ? "linked/patterned" : "photos";
  const std::string plain = paired ? "linked/plain" : "photos";
  const auto extract = [](const std::string& database, const std::string& images) {
    return "colmap feature_extractor --database_path " + database + " --image_path " + images +
           " --SiftExtraction.use_gpu 0 $(cat camera_options.txt)\n";
  };
  std::string lines = "export QT_QPA_PLATFORM=offscreen\n";
  if (paired) {
    lines +=
        "roomtex-associate --image_path photos --output_path associations.csv --links_path "
        "linked\n";
  }
  return lines + extract("database.db", mapped) +
         "colmap exhaustive_matcher --database_path database.db --SiftMatching.use_gpu 0\n"
         "roomtex-mapper --database_path database.db --image_path " +
         mapped +
         " --output_path sparse\n"
         "roomtex-align --input_path sparse/0" +
         scans + " --picks_path picks.csv --image_path " + plain +
         " --output_path aligned\n"
         "roomtex-texture --input_path aligned --image_path " +
         plain + scans + " --output_path textured\n";
}

void WriteReadme(const SimulatedRoom& room, const std::string& folder) {
  const SimulatedRoomOptions& options = room.options();
  std::string scans;
  for (int station = 0; station < room.NumStations(); ++station) {
    scans += " --scan_path " + ScanName(station);
  }
  if (room.NumStations() > 1) scans += " --scan_poses scan_poses.txt";
  std::ostringstream text;
  const bool paired = options.projectors > 0;
  text
      << (options.second_room ? "Two simulated rooms with an open door: " : "A simulated room: ")
      << room.NumPhotos() << " photos and " << room.NumStations()
      << (room.NumStations() == 1 ? " range scan" : " range scans")
      << ", made by roomtex-simulate with seed " << options.random_seed << ".\n\n"
      << "photos/             the photos"
      << (options.exif ? ", exposure in EXIF\n" : ", without EXIF\n")
      << (options.similar_room > 0
              ? fmt::format("                    from {} on of another room, which have no truth\n",
                            SimilarRoomPhotoName(room, 0))
              : "")
      << (options.second_room
              ? fmt::format(
                    "                    from {} on of the second room, from {} on on the way "
                    "through the\n                    door, there and back\n",
                    room.PhotoName(options.num_photos), room.PhotoName(2 * options.num_photos))
              : "")
      << (options.zoomed > 0 ? "                    some taken at 1.3 times the focal length told: "
                               "camera 2 in truth/\n"
                             : "")
      << (paired ? "                    every place twice, the camera unmoved: in the light of the "
                   "projectors,\n"
                   "                    then without it\n"
                 : "")
      << "scan.rtpi           the range scan; azimuth clockwise (the default)\n"
      << (room.NumStations() > 1 ? "scan_N.rtpi         further scans, placed by scan_poses.txt\n"
                                 : "")
      << (options.second_room ? fmt::format("                    from {} on of the second room\n",
                                            ScanName(options.num_stations))
                              : "")
      << "picks.csv           clicks: a pixel of a photo and the scan point seen there\n"
      << (options.second_room
              ? "second_room_picks.csv  the same for the second room, in the frame of its first "
                "scan\n"
              : "")
      << "cameras.txt         the calibrated camera\n"
      << "camera_options.txt  the same as options of colmap feature_extractor\n"
      << "truth/              what the tools have to find out: the true poses in the scan frame "
         "(a COLMAP\n"
      << "                    text model), exposures.csv (EV relative to nominal), "
         "scan_from_room.txt\n"
      << "                    (scale, quaternion w x y z, translation; room: z up, origin in a "
         "corner\n"
      << "                    of the floor) and true_colors.ply (scan points in grid order, "
         "missing\n"
      << "                    ones left out, with their true colour)\n"
      << (options.rolling_shutter_ms > 0 ? "                    rolling_shutter.csv (the camera's "
                                           "motion while a photo is read; "
                                           "poses are\n"
                                           "                    those of its middle row)\n"
                                         : "")
      << (paired ? "                    associations.csv (which photos belong together), "
                   "pattern_N.png and\n"
                   "                    projectors.txt (what the projectors throw, from where)\n"
                 : "")
      << "\nType, in this folder:\n\n"
      << (room.camera().IsPanorama() ? CommandsForPanoramas(scans) : CommandsToType(paired, scans));
  WriteText(folder + "/README.txt", text.str());
}

// Files of an earlier capture in the folder that this one does not have: stale truth, further
// scans.
void RemoveEarlier(OutputSet* outputs) {
  std::vector<std::string> names = {"scan_poses.txt", "second_room_picks.csv"};
  for (const char* name : {"associations.csv", "projectors.txt", "rolling_shutter.csv"}) {
    names.push_back(std::string("truth/") + name);
  }
  const auto add_numbered = [&](const std::string& folder, const std::string& begin,
                                const std::string& end) {
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(outputs->folder() + "/" + folder, ignored)) {
      const std::string name = entry.path().filename().string();
      if (name.size() <= begin.size() + end.size() || !BeginsWith(name, begin) ||
          name.substr(name.size() - end.size()) != end) {
        continue;
      }
      const std::string number = name.substr(begin.size(), name.size() - begin.size() - end.size());
      if (number.find_first_not_of("0123456789") == std::string::npos) {
        names.push_back(folder + name);
      }
    }
  };
  add_numbered("", "scan_", ".rtpi");
  add_numbered("truth/", "pattern_", ".png");
  for (const std::string& name : names) {
    const bool is_earlier =
        fs::exists(outputs->folder() + "/" + name) && !fs::exists(outputs->aside() + "/" + name);
    if (is_earlier) outputs->Remove(name);
  }
}

}  // namespace

CaptureSummary WriteCapture(const SimulatedRoom& room, const std::string& folder,
                            Progress* progress, bool reachable) {
  OutputSet outputs(folder);
  const CaptureSummary summary = MakeCapture(room, progress, reachable, &outputs);
  outputs.Commit();
  return summary;
}

CaptureSummary MakeCapture(const SimulatedRoom& room, Progress* progress, bool reachable,
                           OutputSet* outputs) {
  RequireNoOtherPhotos(room, outputs->folder() + "/photos");
  const std::string folder = outputs->aside(), photo_folder = folder + "/photos";
  MakeFolder(photo_folder);
  MakeFolder(folder + "/truth");
  CaptureSummary summary;
  WriteCamera(room.camera(), folder);
  WriteTruth(room, folder + "/truth");
  WritePicks(room, 0, folder + "/picks.csv", &summary);
  if (room.options().second_room) {
    WritePicks(room, room.options().num_stations, folder + "/second_room_picks.csv", &summary);
  }
  WriteReadme(room, folder);
  WriteScans(room, folder, &summary, progress);
  progress->Stage("photos", room.NumPhotos() + room.options().similar_room);
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    WritePhoto(room, photo, TimeOf(room, photo), photo_folder + "/" + room.PhotoName(photo));
    progress->Tick();
  }
  WriteSimilarRoom(room, photo_folder, progress);
  WriteTrueColors(room, photo_folder, reachable, folder + "/truth", progress);
  RemoveEarlier(outputs);
  progress->Finish();
  return summary;
}

}  // namespace roomtex
