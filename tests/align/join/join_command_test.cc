// roomtex-join as users call it, on rooms of which all is known: models and alignment.json as
// roomtex-align leaves them, with the errors that it expects.

#include <cstring>

#include <gmock/gmock.h>

#include "colmap_ext/sparse_model.h"
#include "core/frames.h"
#include "core/output_file.h"
#include "core/random_stream.h"
#include "core/report.h"
#include "core/twist.h"
#include "importers/scan_record.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::Not;

constexpr double kPositionSigma = 0.002, kRotationSigma = 0.0005;  // along and about an axis

Rigid Turned(double yaw_deg, const Eigen::Vector3d& translation) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(yaw_deg), Eigen::Vector3d::UnitZ())),
          translation};
}

class JoinCommand : public testing::Test {
 protected:
  // A room whose scan frame lies so in that of the site; its errors are half those of the whole
  // room and half those of each photo.
  void AddRoom(const std::string& name, const Rigid& site_from_scan) {
    Room& room = rooms_[name];
    room.site_from_scan = site_from_scan;
    room.common = Noise(rooms_.size(), 0);
    names_.push_back(name);
    ScanRecord scan;
    scan.path = name + ".e57";
    scan.absolute_path = scan.relative_path = scan.path;
    scan.content_hash = "xxh64:" + name;
    scan.up_axis = "z";
    scan.poses.resize(1);
    room.scans = {scan};
    for (int i = 0; i < 3; ++i) {
      AddPhoto(name, "in_" + std::to_string(i) + ".jpg", name + std::to_string(i),
               Eigen::Vector3d(1.5 * i, 2, 1.5));
    }
  }
  // A photo file of this content, registered with errors. wrong_by: metres along x of the site that
  // it is off beside.
  void AddPhoto(const std::string& name, const std::string& file, const std::string& content,
                const Eigen::Vector3d& centre_in_site, double wrong_by = 0) {
    Room& room = rooms_[name];
    SparseImage image;
    image.image_id = static_cast<uint32_t>(room.model.images.size() + 1);
    image.camera_id = 1;
    image.name = file;
    const Rigid site_from_cam = {
        Eigen::Quaterniond(Eigen::AngleAxisd(1.3, Eigen::Vector3d(1, 0.2, 0.1).normalized())),
        centre_in_site + wrong_by * Eigen::Vector3d::UnitX()};
    const Rigid scan_from_cam =
        Moved(Moved(room.site_from_scan.Inverse() * site_from_cam, room.common),
              Noise(rooms_.size(), image.image_id));
    image.cam_from_model = scan_from_cam.Inverse();
    room.model.images[image.image_id] = image;
    MakeFolder(folder_ / (name + "/photos"));
    WriteBytes(folder_ / (name + "/photos/" + file), "photo " + content);
  }
  void AddDoor(const std::string& first, const std::string& second, int num_photos,
               const Eigen::Vector3d& place, double second_wrong_by = 0) {
    for (int i = 0; i < num_photos; ++i) {
      const std::string content = first + "-" + second + std::to_string(i);
      const Eigen::Vector3d centre = place + Eigen::Vector3d(0.4 * i, 0.3 * (i % 2), 0.1 * i);
      AddPhoto(first, content + ".jpg", content, centre);
      AddPhoto(second, "copy of " + content + ".jpg", content, centre, second_wrong_by);
    }
  }
  CommandResult Join(const std::string& more = "") {
    std::string line = "roomtex-join --quiet --output_path " + (folder_ / "joined") + " " + more;
    for (const std::string& name : names_) {
      WriteRoom(name);
      line += " --input_path '" + (folder_ / (name + "/aligned")) + "'";
    }
    const CommandResult result = RunCommandLine(line);
    const std::string report = ReadBytes(folder_ / "joined/joined.json");
    report_ = report.empty() ? Json() : Json::parse(report);
    return result;
  }
  const Json& RoomOf(const std::string& name) const {
    for (const Json& room : report_["rooms"]) {
      if (room["name"] == name) return room;
    }
    throw std::out_of_range(name);
  }
  const Json& LinkOf(const std::string& first, const std::string& second) const {
    for (const Json& link : report_["links"]) {
      if (link["first"] == first && link["second"] == second) return link;
    }
    throw std::out_of_range(first + " " + second);
  }
  // As it was found, of the scan frame in that of the first room.
  Rigid Found(const std::string& name) const {
    const auto q = RoomOf(name)["rotation_wxyz"].get<std::vector<double>>();
    const auto t = RoomOf(name)["translation"].get<std::vector<double>>();
    return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])};
  }
  Rigid True(const std::string& name) const {
    return rooms_.at(names_[0]).site_from_scan.Inverse() * rooms_.at(name).site_from_scan;
  }
  // Metres, at a place some metres from the doors.
  double ErrorOf(const std::string& name) const {
    const Eigen::Vector3d place =
        rooms_.at(name).site_from_scan.Inverse() * Eigen::Vector3d(1, 2, 0.5);
    return (Found(name) * place - True(name) * place).norm();
  }

  struct Room {
    Rigid site_from_scan;
    Eigen::Matrix<double, 6, 1> common;
    SparseModel model;
    std::vector<ScanRecord> scans;
    bool trusted = true;
    std::string doubtful;       // a photo that roomtex-align doubts
    std::string without_error;  // one of which it does not say how exactly it stands
  };
  TempFolder folder_;
  std::map<std::string, Room> rooms_;
  std::vector<std::string> names_;
  Json report_;

 private:
  // Half the variance that is expected.
  static Eigen::Matrix<double, 6, 1> Noise(uint64_t room, uint64_t photo) {
    RandomStream random(MixBits(1, room, photo));
    Eigen::Matrix<double, 6, 1> noise;
    for (int k = 0; k < 6; ++k) {
      noise[k] = random.Gaussian() * (k < 3 ? kRotationSigma : kPositionSigma) / std::sqrt(2);
    }
    return noise;
  }
  void WriteRoom(const std::string& name) {
    Room& room = rooms_[name];
    const std::string aligned = folder_ / (name + "/aligned");
    Camera& camera = room.model.cameras[1];
    camera.camera_id = 1;
    camera.model = CameraModel::kSimplePinhole;
    camera.width = camera.height = 100;
    camera.params = {100, 50, 50};
    WriteSparseModel(room.model, aligned);
    Json json = {{"trusted", room.trusted},
                 {"reason", room.trusted ? "" : "the picks are few"},
                 {"options", {{"image_path", folder_ / (name + "/photos")}}},
                 {"scans", ToJson(room.scans)},
                 {"images", Json::array()}};
    for (const auto& [id, image] : room.model.images) {
      json["images"].push_back(
          {{"name", image.name},
           {"position_sigma_mm", 1000 * std::sqrt(3) * kPositionSigma},
           {"rotation_sigma_deg", DegFromRad(std::sqrt(3) * kRotationSigma)},
           {"doubt", image.name == room.doubtful ? Json("It is alone.") : Json()}});
      if (image.name == room.without_error) {
        json["images"].back().erase("position_sigma_mm");
        json["images"].back().erase("rotation_sigma_deg");
      }
    }
    WriteBytes(aligned + "/alignment.json", json.dump());
  }
};

TEST_F(JoinCommand, PlacesRoomsByThePhotosOfTheirDoorways) {
  // UTM coordinates in one room, of another no photo is shared.
  AddRoom("hall", Turned(0, {0, 0, 0}));
  AddRoom("library", Turned(35, {-412340, -5654320, -120}));
  AddRoom("stairs", Turned(-120, {5, 6, 0}));
  AddRoom("attic", Turned(10, {0, 0, 9}));
  AddDoor("hall", "library", 4, {4, 1, 1.5});
  AddDoor("library", "stairs", 3, {5, 5, 1.5});
  const CommandResult open = Join();
  ASSERT_EQ(open.exit_code, 0) << open.err;
  EXPECT_TRUE(report_["loops"].empty());
  EXPECT_TRUE(LinkOf("hall", "library")["residual"].is_null());

  AddDoor("hall", "stairs", 3, {1, 4, 1.5});
  const CommandResult result = Join();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("3 of 4 rooms in the frame of hall, 3 links"));
  EXPECT_THAT(report_["warnings"].dump(), HasSubstr("not in its frame: attic."));
  EXPECT_EQ(RoomOf("attic")["frame"], "attic");
  EXPECT_EQ(Found("hall").Matrix(), Rigid().Matrix());
  EXPECT_LT(ErrorOf("stairs"), 0.006);
  EXPECT_LT(ErrorOf("library"), 0.006);
  for (const char* name : {"library", "stairs"}) {
    EXPECT_LT(RotationAngle(Found(name).rotation, True(name).rotation), 0.002);
    EXPECT_THAT(RoomOf(name)["position_sigma_mm"],
                testing::AllOf(testing::Gt(1.0), testing::Lt(12.0)));
  }
  ASSERT_EQ(report_["loops"].size(), 1u);
  EXPECT_EQ(report_["loops"][0]["closes"], true);
  EXPECT_LT(report_["loops"][0]["offset_mm"], 20);
  EXPECT_LT(LinkOf("hall", "stairs")["residual"]["offset_mm"], 10);
  const Json& rows = RoomOf("stairs")["site_from_room"];
  const Similarity written = ReadSimilarity(folder_ / "joined/stairs.txt");
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      EXPECT_NEAR(rows[row][column], written.Matrix()(row, column), 1e-9);
    }
  }
}

TEST_F(JoinCommand, NamesThePhotoThatIsWrongInOneRoom) {
  AddRoom("hall", Rigid());
  AddRoom("library", Turned(35, {4, 1, 0}));
  AddDoor("hall", "library", 3, {4, 1, 1.5});
  AddPhoto("hall", "x.jpg", "x", {4, 2, 1.5});
  AddPhoto("library", "x.jpg", "x", {4, 2, 1.5}, 0.5);
  const CommandResult result = Join();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(report_["warnings"].dump(), HasSubstr("x.jpg puts hall and library"));
  EXPECT_LT(ErrorOf("library"), 0.006);
  EXPECT_EQ(LinkOf("hall", "library")["num_agreeing"], 3);
  EXPECT_EQ(LinkOf("hall", "library")["num_photos"], 4);

  rooms_["library"].doubtful = "x.jpg";
  ASSERT_EQ(Join().exit_code, 0);
  EXPECT_EQ(LinkOf("hall", "library")["num_photos"], 3);
  EXPECT_THAT(
      report_["warnings"].dump(),
      HasSubstr("photos of library that are doubtful link it to no other room: 1, e.g. x.jpg"));
}

TEST_F(JoinCommand, DoesNotTrustWhatNothingConfirms) {
  AddRoom("hall", Rigid());
  AddRoom("library", Turned(35, {4, 1, 0}));
  AddDoor("hall", "library", 1, {4, 1, 1.5});
  EXPECT_EQ(Join().exit_code, 4);
  EXPECT_THAT(LinkOf("hall", "library")["reason"].get<std::string>(), HasSubstr("one photo alone"));
  EXPECT_EQ(RoomOf("library")["trusted"], false);
  EXPECT_LT(ErrorOf("library"), 0.01);

  // A second one that says something else.
  AddPhoto("hall", "x.jpg", "x", {4, 2, 1.5});
  AddPhoto("library", "x.jpg", "x", {4, 2, 1.5}, 0.5);
  EXPECT_EQ(Join().exit_code, 4);
  EXPECT_THAT(LinkOf("hall", "library")["reason"].get<std::string>(), HasSubstr("only 1 of them"));

  // Not for its own, but for a room's.
  AddDoor("library", "hall", 3, {4, 1, 1.5});
  EXPECT_EQ(Join().exit_code, 0);
  rooms_["library"].trusted = false;
  const CommandResult doubted = Join();
  EXPECT_EQ(doubted.exit_code, 4);
  EXPECT_THAT(doubted.err, HasSubstr("the picks are few"));
  EXPECT_EQ(Join("--accept_untrusted 1").exit_code, 0);
}

// Rooms in a ring, with a door across: the photos of one door agree with each other, and are off in
// one room together.
TEST_F(JoinCommand, NamesTheDoorThatContradictsTheOthers) {
  AddRoom("a", Rigid());
  AddRoom("b", Turned(90, {5, 0, 0}));
  AddRoom("c", Turned(-40, {5, 5, 0}));
  AddRoom("d", Turned(170, {0, 5, 0}));
  AddDoor("a", "b", 3, {2.5, 0, 1.5});
  AddDoor("b", "c", 3, {5, 2.5, 1.5}, 0.3);
  AddDoor("c", "d", 3, {2.5, 5, 1.5});
  AddDoor("a", "d", 3, {0, 2.5, 1.5});
  AddDoor("a", "c", 3, {2.5, 2.5, 1.5});
  const CommandResult result = Join();
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(report_["reason"].get<std::string>(), HasSubstr("between b and c"));
  EXPECT_THAT(report_["reason"].get<std::string>(), Not(HasSubstr("between c and d")));
  EXPECT_EQ(LinkOf("b", "c")["trusted"], false);
  EXPECT_NEAR(LinkOf("b", "c")["residual"]["offset_mm"], 300, 20);
  for (const auto& [first, second] : {std::pair{"c", "d"}, {"a", "d"}, {"a", "c"}}) {
    EXPECT_EQ(LinkOf(first, second)["trusted"], true) << first << second;
  }
  for (const char* name : {"c", "d"}) {
    EXPECT_EQ(RoomOf(name)["trusted"], true) << name;
    EXPECT_LT(ErrorOf(name), 0.008) << name;
  }
}

TEST_F(JoinCommand, TakesScansOfOneFileAsOneFrame) {
  AddRoom("hall", Rigid());
  AddRoom("library", Rigid());
  AddRoom("stairs", Turned(90, {5, 5, 0}));
  // Parts of one file, and one scan that lies elsewhere in the frame of each.
  for (const char* name : {"hall", "library"}) {
    rooms_[name].scans[0].content_hash = "xxh64:house";
    rooms_[name].scans[0].part = name;
    rooms_[name].scans[0].poses[0].scan_from_station.translation = {1, 2, 3};
  }
  ScanRecord shared = rooms_["library"].scans[0];
  shared.content_hash = "xxh64:landing";
  shared.poses[0].given = true;
  shared.poses[0].scan_from_station = Turned(20, {4, 4, 1.5});
  rooms_["library"].scans.push_back(shared);
  shared.poses[0].scan_from_station =
      rooms_["stairs"].site_from_scan.Inverse() * shared.poses[0].scan_from_station;
  rooms_["stairs"].scans.push_back(shared);
  AddDoor("hall", "library", 2, {4, 1, 1.5});
  const CommandResult result = Join();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_LT(ErrorOf("library"), 0.0005);
  EXPECT_LT(ErrorOf("stairs"), 0.0005);
  EXPECT_EQ(LinkOf("hall", "library")["num_scans"], 1);
  // The photos' own residuals are said.
  EXPECT_GT(LinkOf("hall", "library")["views"][0]["offset_mm"], 0.3);

  rooms_["stairs"].scans[1].meters_per_unit = 0.3048;
  EXPECT_EQ(Join().exit_code, 4);
  EXPECT_THAT(report_["reason"].get<std::string>(), HasSubstr("was read in another way"));
}

TEST_F(JoinCommand, ComparesScansThatAreRegistered) {
  AddRoom("hall", Rigid());
  AddRoom("library", Rigid());
  AddDoor("hall", "library", 3, {4, 1, 1.5});
  EXPECT_EQ(Join("--registered 1").exit_code, 0);
  EXPECT_EQ(Found("library").Matrix(), Rigid().Matrix());
  EXPECT_LT(LinkOf("hall", "library")["residual"]["offset_mm"], 10);
  AddRoom("stairs", Turned(0, {0.1, 0, 0}));
  AddDoor("hall", "stairs", 3, {1, 4, 1.5});
  EXPECT_EQ(Join("--registered 1").exit_code, 4);
  EXPECT_EQ(RoomOf("stairs")["trusted"], false);
  EXPECT_NEAR(LinkOf("hall", "stairs")["residual"]["offset_mm"], 100, 15);
}

// A binary glTF of one triangle in a node that stands where its scan's middle is.
void WriteTriangle(const std::string& path, const std::vector<float>& corners,
                   const std::string& image) {
  Json json = Json::parse(R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
      "nodes": [{"rotation": [-0.7071067811865476, 0, 0, 0.7071067811865476], "children": [1]},
                {"mesh": 0, "translation": [1, 2, 3]}],
      "buffers": [{}],
      "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
      "images": [{"bufferView": 1, "mimeType": "image/png"}], "textures": [{"source": 0}],
      "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}]})");
  json["buffers"][0]["byteLength"] = 36 + image.size();
  json["bufferViews"][1]["byteLength"] = image.size();
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const auto number = [](size_t value) {
    const auto word = static_cast<uint32_t>(value);
    return std::string(reinterpret_cast<const char*>(&word), 4);
  };
  const std::string buffer = std::string(reinterpret_cast<const char*>(corners.data()), 36) + image;
  WriteBytes(path, "glTF" + number(2) + number(28 + text.size() + buffer.size()) +
                       number(text.size()) + "JSON" + text + number(buffer.size()) +
                       std::string("BIN\0", 4) + buffer);
}

TEST_F(JoinCommand, ShowsAllRoomsInOneScene) {
  AddRoom("hall", Rigid());
  AddRoom("my library", Turned(90, {5, 5, 0}));
  AddDoor("hall", "my library", 3, {4, 1, 1.5});
  for (const std::string name : {"hall", "my library"}) {
    MakeFolder(folder_ / (name + "/textured"));
    WriteTriangle(folder_ / (name + "/textured/model.glb"), {0, 0, 0, 1, 0, 0, 0, 1, 0},
                  "picture of " + name + "..");
  }
  ASSERT_EQ(Join().exit_code, 0);
  EXPECT_EQ(report_["scene"], "site.gltf");
  const Json scene = Json::parse(ReadBytes(folder_ / "joined/site.gltf"));
  const auto bytes_of = [&](const Json& view) {
    EXPECT_EQ(scene["buffers"][1]["uri"], "../my%20library/textured/model.glb");
    const std::string name = view["buffer"] == 0 ? "hall" : "my library";
    const std::string file = ReadBytes(folder_ / (name + "/textured/model.glb"));
    EXPECT_EQ(scene["buffers"][view["buffer"].get<size_t>()]["byteLength"], file.size());
    return file.substr(view["byteOffset"], view["byteLength"]);
  };
  const Json& root = scene["nodes"][0];
  ASSERT_EQ(root["children"].size(), 2u);
  EXPECT_NEAR(root["rotation"][0], -std::sqrt(0.5), 1e-9);
  const Json& room = scene["nodes"][root["children"][1].get<size_t>()];
  EXPECT_EQ(room["name"], "my library");
  const Json& node = scene["nodes"][room["children"][0].get<size_t>()];
  const Json& primitive = scene["meshes"][node["mesh"].get<size_t>()]["primitives"][0];
  const Json& material = scene["materials"][primitive["material"].get<size_t>()];
  const size_t texture = material["pbrMetallicRoughness"]["baseColorTexture"]["index"];
  const size_t image = scene["textures"][texture]["source"];
  const size_t view = scene["images"][image]["bufferView"];
  EXPECT_EQ(bytes_of(scene["bufferViews"][view]), "picture of my library..");
  const size_t accessor = primitive["attributes"]["POSITION"];
  const std::string corners =
      bytes_of(scene["bufferViews"][scene["accessors"][accessor]["bufferView"].get<size_t>()]);
  float second[3];
  std::memcpy(second, corners.data() + 12, 12);
  EXPECT_EQ(second[0], 1);
  // The corner (1, 0, 0) about (1, 2, 3), turned with the room.
  const auto q = room["rotation"].get<std::vector<double>>();
  const auto t = room["translation"].get<std::vector<double>>();
  const Rigid site_from_scan = {Eigen::Quaterniond(q[3], q[0], q[1], q[2]),
                                Eigen::Vector3d(t[0], t[1], t[2])};
  EXPECT_LT((site_from_scan * Eigen::Vector3d(2, 2, 3) - Eigen::Vector3d(3, 7, 3)).norm(), 0.008);

  WriteBytes(folder_ / "hall/textured/model.glb", "glTF, cut off");
  const CommandResult broken = Join();
  EXPECT_EQ(broken.exit_code, 3);
  EXPECT_THAT(broken.err, HasSubstr("model.glb"));
}

TEST_F(JoinCommand, MakesNoSceneWhereNothingLinksTheRooms) {
  AddRoom("hall", Rigid());
  AddRoom("library", Turned(90, {5, 5, 0}));
  for (const std::string name : {"hall", "library"}) {
    MakeFolder(folder_ / (name + "/textured"));
    WriteTriangle(folder_ / (name + "/textured/model.glb"), {0, 0, 0, 1, 0, 0, 0, 1, 0}, "..");
  }
  Join();
  EXPECT_EQ(RoomOf("library")["frame"], "library");
  EXPECT_TRUE(report_.at("scene").is_null());
  EXPECT_FALSE(std::filesystem::exists(folder_ / "joined/site.gltf"));
}

// Who reads a path on stdout finds what is there.
TEST_F(JoinCommand, NamesNoFolderThatDoesNotAppear) {
  AddRoom("hall", Rigid());
  AddRoom("library", Turned(90, {5, 5, 0}));
  AddDoor("hall", "library", 3, {1, 2, 1});
  EXPECT_EQ(Join("--report_path /sys/r.json").out, "");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "joined/joined.json"));
  EXPECT_EQ(Join().out,
            "2 of 2 rooms in the frame of hall, 1 links\n" + (folder_ / "joined") + "\n");
}

// A matrix of a room that is in no common frame would lay it over the first one.
TEST_F(JoinCommand, WritesNoPlaceOfARoomThatIsNowhere) {
  AddRoom("hall", Rigid());
  AddRoom("library", Turned(90, {5, 5, 0}));
  AddDoor("hall", "library", 3, {1, 2, 1});
  AddRoom("attic", Rigid());
  EXPECT_EQ(Join().exit_code, 0);
  const auto is_there = [&](const char* name) {
    return std::filesystem::exists(folder_ / (std::string("joined/") + name));
  };
  EXPECT_TRUE(is_there("hall.txt"));
  EXPECT_TRUE(is_there("library.txt"));
  EXPECT_FALSE(is_there("attic.txt"));
  EXPECT_EQ(RoomOf("attic")["frame"], "attic");
  EXPECT_TRUE(RoomOf("attic")["position_sigma_mm"].is_null());
  EXPECT_TRUE(RoomOf("attic")["rotation_sigma_deg"].is_null());
  EXPECT_EQ(RoomOf("hall")["position_sigma_mm"], 0);
  EXPECT_GT(RoomOf("library")["position_sigma_mm"], 0);

  // Scans that are said to be registered: there is a place, and nothing to compare it with.
  const CommandResult registered = Join("--registered 1");
  EXPECT_EQ(registered.exit_code, 4);  // hall and library do not lie in one frame
  EXPECT_TRUE(is_there("attic.txt"));
  EXPECT_TRUE(RoomOf("attic")["position_sigma_mm"].is_null());
  EXPECT_THAT(report_["warnings"].dump(), HasSubstr("nothing was compared"));
  EXPECT_THAT(report_["warnings"].dump(), HasSubstr(": attic"));

  // Nor does one of an earlier run stay; a file of somebody's does.
  WriteBytes(folder_ / "joined/mine.txt", "notes");
  names_ = {"hall", "attic"};
  EXPECT_EQ(Join().exit_code, 0);
  EXPECT_FALSE(is_there("library.txt"));
  EXPECT_FALSE(is_there("attic.txt"));
  EXPECT_TRUE(is_there("hall.txt"));
  EXPECT_TRUE(is_there("mine.txt"));
}

TEST_F(JoinCommand, SaysWhichPhotosHaveNoExpectedError) {
  AddRoom("hall", Rigid());
  AddRoom("library", Turned(90, {5, 5, 0}));
  AddDoor("hall", "library", 3, {1, 2, 1});
  rooms_["hall"].without_error = "hall-library0.jpg";
  Join();
  EXPECT_EQ(LinkOf("hall", "library")["num_photos"], 2);
  EXPECT_THAT(report_["warnings"].dump(), HasSubstr("how exactly they stand"));
}

TEST_F(JoinCommand, SaysWhatCannotBeUsed) {
  AddRoom("hall", Rigid());
  EXPECT_EQ(Join().exit_code, 0) << "one room is its own site";
  const std::string aligned = folder_ / "hall/aligned";
  const CommandResult twice = Join("--input_path " + aligned);
  EXPECT_EQ(twice.exit_code, 2);
  EXPECT_THAT(twice.err, HasSubstr("both called hall"));
  EXPECT_EQ(Join("--image_path a --image_path b").exit_code, 2);
  for (const char* text : {"{", "[]", "{\"scans\": [{}]}"}) {
    WriteBytes(aligned + "/alignment.json", text);
    const CommandResult broken = RunCommandLine("roomtex-join --input_path " + aligned +
                                                " --output_path " + (folder_ / "j"));
    EXPECT_EQ(broken.exit_code, 3) << text << broken.err;
    EXPECT_THAT(broken.err, HasSubstr("alignment.json")) << text;
  }
  std::filesystem::create_directory(folder_ / "refused");
  WriteBytes(
      folder_ / "refused/alignment.json",
      R"({"command": "roomtex-align", "trusted": false, "reason": "The picks lie on a line."})");
  const CommandResult refused = RunCommandLine(
      "roomtex-join --input_path " + (folder_ / "refused") + " --output_path " + (folder_ / "j"));
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err, HasSubstr("refused to align: The picks lie on a line."));
  std::filesystem::remove(aligned + "/alignment.json");
  EXPECT_EQ(
      RunCommandLine("roomtex-join --input_path " + aligned + " --output_path " + (folder_ / "j"))
          .exit_code,
      3);
}

}  // namespace
}  // namespace roomtex
