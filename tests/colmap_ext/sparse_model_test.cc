#include "colmap_ext/sparse_model.h"

#include <chrono>
#include <cstring>
#include <filesystem>

#include "core/error.h"
#include "tests/colmap_ext/sparse_model_maker.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

TEST(SparseModel, BinaryRoundTripIsExact) {
  const TempFolder folder;
  const SparseModel model = MakeSparseModel();
  WriteSparseModel(model, folder / "made/on/the/way");
  ExpectSameModel(ReadSparseModel(folder / "made/on/the/way"), model);
}

TEST(SparseModel, TextRoundTripIsExact) {
  const TempFolder folder;
  const SparseModel model = MakeSparseModel();
  WriteSparseModelText(model, folder.path());
  ExpectSameModel(ReadSparseModel(folder.path()), model);
}

TEST(SparseModel, EmptyModelGoesRound) {
  const TempFolder folder;
  WriteSparseModel({}, folder / "bin");
  WriteSparseModelText({}, folder / "txt");
  EXPECT_TRUE(ReadSparseModel(folder / "bin").images.empty());
  EXPECT_TRUE(ReadSparseModel(folder / "txt").images.empty());
}

TEST(SparseModel, BinaryWinsOverText) {
  const TempFolder folder;
  WriteSparseModelText(MakeSparseModel({5, 10, 3}), folder.path());
  WriteSparseModel(MakeSparseModel(), folder.path());
  EXPECT_EQ(ReadSparseModel(folder.path()).images.size(), 4u);
}

TEST(SparseModel, WholeTextWinsOverHalfABinary) {
  const TempFolder folder;
  WriteSparseModelText(MakeSparseModel({5, 10, 3}), folder.path());
  WriteSparseModel(MakeSparseModel(), folder.path());
  fs::remove(folder / "points3D.bin");
  EXPECT_EQ(ReadSparseModel(folder.path()).images.size(), 5u);
}

TEST(SparseModel, EveryCameraModelComesBack) {
  for (int id = 0; id < kNumCameraModels; ++id) {
    SparseModel model;
    Camera& camera = model.cameras[4];
    camera.camera_id = 4;
    camera.model = static_cast<CameraModel>(id);
    camera.width = 640;
    camera.height = 320;
    camera.params = std::vector<double>(NumCameraParams(id), 0.75);
    ASSERT_TRUE(camera.Problems().empty());
    const TempFolder binary, text;
    WriteSparseModel(model, binary.path());
    ExpectSameModel(ReadSparseModel(binary.path()), model);
    WriteSparseModelText(model, text.path());
    ExpectSameModel(ReadSparseModel(text.path()), model);
  }
}

TEST(SparseModel, FramesSayWhichImagesMoveAsOne) {
  const TempFolder folder;
  WriteSparseModelText(MakeSparseModel(), folder.path());
  WriteBytes(folder / "frames.txt",
             "# FRAME_ID, RIG_ID, RIG_FROM_WORLD[], NUM_DATA_IDS, DATA_IDS[]\n"
             "7 1 1 0 0 0 0 0 0 2 CAMERA 3 50 CAMERA 12 43\n"
             "8 1 1 0 0 0 0 0 0 2 CAMERA 3 36 CAMERA 12 999\n"
             "9 1 1 0 0 0 0 0 0 2 IMU 1 50 CAMERA 12 29\n");
  const SparseModel model = ReadSparseModel(folder.path());
  EXPECT_EQ(model.images.at(50).frame_id, 7u);
  EXPECT_EQ(model.images.at(43).frame_id, 7u);
  // Alone in their frames, as far as the model goes.
  EXPECT_EQ(model.images.at(36).frame_id, kNoFrame);
  EXPECT_EQ(model.images.at(29).frame_id, kNoFrame);
  WriteBytes(folder / "frames.txt", "7 1 1 0 0 0 0 0 0 2 CAMERA 3 50\n");
  EXPECT_INPUT_ERROR(ReadSparseModel(folder.path()), "frames.txt");
}

TEST(SparseModel, RigsAreToleratedWhenReadAndRefusedWhenWritten) {
  const TempFolder folder;
  WriteSparseModel(MakeSparseModel(), folder.path());
  WriteBytes(folder / "rigs.bin", "whatever");
  WriteBytes(folder / "frames.bin", std::string(8, '\0'));  // none
  ExpectSameModel(ReadSparseModel(folder.path()), MakeSparseModel());
  const std::string before = ReadBytes(folder / "images.bin");
  EXPECT_INPUT_ERROR(WriteSparseModel(SparseModel(), folder.path()), "rigs.bin");
  EXPECT_EQ(ReadBytes(folder / "images.bin"), before);
}

TEST(SparseModel, FindsImagesByName) {
  const SparseModel model = MakeSparseModel();
  ASSERT_NE(model.FindImage("second folder/photo 1.jpg"), nullptr);
  EXPECT_EQ(model.FindImage("second folder/photo 1.jpg")->image_id, 43u);
  EXPECT_EQ(model.FindImage("photo"), nullptr);
}

TEST(SparseModel, TextMayBeWrittenByHand) {
  const TempFolder folder;
  // With the byte order mark of an editor of Windows.
  WriteBytes(folder / "cameras.txt",
             "\xEF\xBB\xBF# cameras\r\n\r\n  1\tPINHOLE 640   480 +500 5e2 320 240 \r\n");
  WriteBytes(folder / "images.txt",
             "# images\n\n"
             "4 2 0 0 0 0.5 -1e-3 7 1 a photo with  spaces.jpg  \r\n"
             "\r\n"
             "# the next one\n"
             "2 1 0 0 0 0 0 0 1 b.jpg\n"
             "# its keypoints\n"
             " 1.5 2.5 -1  3.5 4.5 77\n"
             "\n"
             "1 1 0 0 0 0 0 0 1 the last line is missing.jpg");
  WriteBytes(folder / "points3D.txt", "\xEF\xBB\xBF\n#\n77 1 2 3 255 0 7 -1 2 1");
  const SparseModel model = ReadSparseModel(folder.path());
  EXPECT_EQ(model.cameras.at(1).params, (std::vector<double>{500, 500, 320, 240}));
  ASSERT_EQ(model.images.size(), 3u);
  EXPECT_EQ(model.images.at(4).name, "a photo with  spaces.jpg");
  EXPECT_EQ(model.images.at(4).cam_from_model.rotation.w(), 1);  // made a unit quaternion
  EXPECT_EQ(model.images.at(4).cam_from_model.translation, Eigen::Vector3d(0.5, -0.001, 7));
  EXPECT_TRUE(model.images.at(4).points2d.empty());
  EXPECT_EQ(model.images.at(2).point3d_ids, (std::vector<uint64_t>{kInvalidPoint3dId, 77}));
  EXPECT_EQ(model.images.at(2).points2d[1], Eigen::Vector2d(3.5, 4.5));
  EXPECT_EQ(model.points.at(77).track.at(0).point2d_index, 1u);
  EXPECT_EQ(model.points.at(77).error, -1);
}

TEST(SparseModel, TextHasSingleSpacesOnly) {
  const TempFolder folder;
  WriteSparseModelText(MakeSparseModel(), folder.path());
  for (const char* file : {"cameras.txt", "images.txt", "points3D.txt"}) {
    const std::string text = ReadBytes(folder / file);
    EXPECT_EQ(text.find("  "), std::string::npos) << file;
    EXPECT_EQ(text.find(" \n"), std::string::npos) << file;
  }
}

// What is refused.

TEST(BadSparseModel, FolderWithoutAModelIsRefused) {
  const TempFolder folder;
  EXPECT_INPUT_ERROR(ReadSparseModel(folder / "missing"), "does not exist");
  EXPECT_INPUT_ERROR(ReadSparseModel(folder.path()), "holds no COLMAP model");
  WriteSparseModel(MakeSparseModel(), folder / "0");
  EXPECT_INPUT_ERROR(ReadSparseModel(folder.path()), "There is one in " + (folder / "0"));
  EXPECT_INPUT_ERROR(ReadSparseModel(folder / "0/images.bin"), "is a file, expected a folder");
  fs::remove(folder / "0/images.bin");
  EXPECT_INPUT_ERROR(ReadSparseModel(folder / "0"), "without images.bin");
}

class BadFile : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const SparseModel model = MakeSparseModel({3, 4, 1});
    fs::path(GetParam()).extension() == ".bin" ? WriteSparseModel(model, folder_.path())
                                               : WriteSparseModelText(model, folder_.path());
    path_ = folder_ / GetParam();
    bytes_ = ReadBytes(path_);
  }
  TempFolder folder_;
  std::string path_, bytes_;
};
INSTANTIATE_TEST_SUITE_P(All, BadFile,
                         testing::Values("cameras.bin", "images.bin", "points3D.bin", "cameras.txt",
                                         "images.txt", "points3D.txt"),
                         [](const auto& file) {
                           std::string name = file.param;
                           name[name.find('.')] = '_';
                           return name;
                         });

TEST_P(BadFile, TruncatedAtAnyByteIsRefusedOrAWholeModel) {
  const bool binary = fs::path(path_).extension() == ".bin";
  int num_refused = 0;
  for (size_t size = 0; size < bytes_.size(); ++size) {
    WriteBytes(path_, bytes_.substr(0, size));
    try {
      const SparseModel model = ReadSparseModel(folder_.path());
      EXPECT_FALSE(binary) << size << " of " << bytes_.size() << " bytes";
      for (const auto& [id, point] : model.points) {
        for (const TrackElement& element : point.track) {
          EXPECT_EQ(model.images.at(element.image_id).point3d_ids.at(element.point2d_index), id);
        }
      }
    } catch (const InputError& error) {
      ++num_refused;
      EXPECT_NE(std::string(error.what()).find(folder_.path()), std::string::npos);
      EXPECT_TRUE(std::strstr(error.what(), ": byte ") || std::strstr(error.what(), ": line "))
          << error.what();
    }
  }
  // A text cut within its last number, or behind it, may still be a model.
  EXPECT_GE(num_refused, static_cast<int>(bytes_.size()) - (binary ? 0 : 100));
}

TEST_P(BadFile, DamagedAtAnyByteNeverCrashes) {
  for (size_t i = 0; i < bytes_.size(); ++i) {
    for (const int value : {0, 0xff, 0x80, int('-'), int(' '), int('\n'), int('9')}) {
      std::string damaged = bytes_;
      damaged[i] = static_cast<char>(value);
      WriteBytes(path_, damaged);
      try {
        ReadSparseModel(folder_.path());
      } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find(folder_.path()), std::string::npos);
      }
    }
  }
}

TEST_P(BadFile, FollowedByMoreIsRefused) {
  WriteBytes(path_, bytes_ + "more");
  EXPECT_INPUT_ERROR(ReadSparseModel(folder_.path()), path_);
}

class BadBinaryFile : public BadFile {};
INSTANTIATE_TEST_SUITE_P(All, BadBinaryFile,
                         testing::Values("cameras.bin", "images.bin", "points3D.bin"),
                         [](const auto& file) {
                           return std::string(file.param, std::strchr(file.param, '.'));
                         });

TEST_P(BadBinaryFile, HugeCountIsRefusedAtOnce) {
  const auto start = std::chrono::steady_clock::now();
  for (const uint64_t count : {uint64_t{1} << 40, UINT64_MAX, UINT64_MAX / 8 + 1}) {
    std::string damaged = bytes_;
    std::memcpy(damaged.data(), &count, sizeof(count));
    WriteBytes(path_, damaged);
    EXPECT_INPUT_ERROR(ReadSparseModel(folder_.path()), "promises " + std::to_string(count));
  }
  EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(), 1.0);
}

// A text model in which one word of a file is replaced.
void ExpectTextRefused(const char* file, const std::string& old_text, const std::string& new_text,
                       const std::string& finding) {
  const TempFolder folder;
  WriteBytes(folder / "cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n");
  WriteBytes(folder / "images.txt",
             "1 1 0 0 0 0 0 0 1 a.jpg\n1 2 5 3 4 -1\n2 1 0 0 0 0 0 0 1 b.jpg\n7 8 5\n");
  WriteBytes(folder / "points3D.txt", "5 1 2 3 10 20 30 0.5 1 0 2 0\n");
  ASSERT_EQ(ReadSparseModel(folder.path()).points.size(), 1u);
  std::string text = ReadBytes(folder / file);
  const size_t at = text.find(old_text);
  ASSERT_NE(at, std::string::npos) << old_text;
  WriteBytes(folder / file, text.replace(at, old_text.size(), new_text));
  EXPECT_INPUT_ERROR(ReadSparseModel(folder.path()), finding);
  EXPECT_INPUT_ERROR(ReadSparseModel(folder.path()), ": line ");
}

TEST(BadSparseModel, ImpossibleCamerasAreRefused) {
  const char* file = "cameras.txt";
  ExpectTextRefused(file, "PINHOLE", "PINHOLES", "unknown model \"PINHOLES\"");
  ExpectTextRefused(file, " 240", "", "PINHOLE with 3 parameters. Expected 4");
  ExpectTextRefused(file, " 240", " 240 1", "PINHOLE with 5 parameters. Expected 4");
  ExpectTextRefused(file, "640", "-640", "\"-640\" is not a whole number");
  ExpectTextRefused(file, "640", "0", "image size 0 x 480");
  ExpectTextRefused(file, "640", "6e2", "\"6e2\" is not a whole number");
  ExpectTextRefused(file, " 500 500", " -500 500", "focal length");
  ExpectTextRefused(file, " 500 500", " nan 500", "\"nan\" is not a finite number");
  ExpectTextRefused(file, " 500 500", " 1e999 500", "\"1e999\" is not a finite number");
  ExpectTextRefused(file, " 500 500", " 500px 500", "\"500px\" is not a number");
  ExpectTextRefused(file, "1 PINHOLE", "99999999999 PINHOLE", "\"99999999999\" is not a whole");
  ExpectTextRefused(file, "240\n", "240\n1 PINHOLE 640 480 500 500 320 240\n",
                    "camera 1 is there twice, first at line 1");
}

TEST(BadSparseModel, ImpossibleImagesAreRefused) {
  const char* file = "images.txt";
  ExpectTextRefused(file, "1 1 0 0 0 0", "1 0 0 0 0 0", "not a rotation");
  ExpectTextRefused(file, "1 1 0 0 0 0", "1 1 nan 0 0 0", "\"nan\" is not a finite number");
  ExpectTextRefused(file, " a.jpg", "", "the line ends too early");
  ExpectTextRefused(file, "b.jpg", "a.jpg", "image 2 has the name a.jpg of another image");
  ExpectTextRefused(file, "1 a.jpg", "9 a.jpg", "image 1 names camera 9");
  ExpectTextRefused(file, "2 1 0 0", "1 1 0 0", "image 1 is there twice");
  ExpectTextRefused(file, "3 4 -1", "3 4", "the line ends too early");
  ExpectTextRefused(file, "3 4 -1", "3 4 -2", "\"-2\" is not a point's id");
  ExpectTextRefused(file, "3 4 -1", "3 4 6", "names point 6");
  ExpectTextRefused(file, "3 4 -1", "3 4 5", "names point 5");
  ExpectTextRefused(file, "3 4 -1", "inf 4 -1", "\"inf\" is not a finite number");
  // The empty line of an image without keypoints is missing.
  ExpectTextRefused(file, "1 2 5 3 4 -1\n", "", "an empty line when it has no keypoints");
}

TEST(BadSparseModel, ImpossiblePointsAreRefused) {
  const char* file = "points3D.txt";
  ExpectTextRefused(file, "10 20 30", "256 20 30", "\"256\" is not a whole number from 0 to 255");
  ExpectTextRefused(file, "5 1 2 3", "5 1 2 nan", "\"nan\" is not a finite number");
  ExpectTextRefused(file, "5 1 2 3", "-5 1 2 3", "\"-5\" is not a whole number");
  ExpectTextRefused(file, "5 1 2 3", "6 1 2 3", "names point 5");
  ExpectTextRefused(file, " 2 0\n", " 2\n", "the line ends too early");
  ExpectTextRefused(file, " 2 0\n", " 3 0\n", "is seen in image 3");
  ExpectTextRefused(file, " 2 0\n", " 2 1\n", "keypoint 1 of image 2, which has 1");
  ExpectTextRefused(file, " 2 0\n", " 1 1\n", "names no point");
  ExpectTextRefused(file, " 2 0\n", "\n", "keypoint 0 of image 2 names point 5");
  ExpectTextRefused(file, " 2 0\n", " 2 0\n5 1 2 3 10 20 30 0.5\n", "point 5 is there twice");
}

TEST(BadSparseModel, TrackElementTwiceIsRefused) {
  const TempFolder folder;
  SparseModel model = MakeSparseModel();
  model.points.begin()->second.track.push_back(model.points.begin()->second.track[0]);
  WriteSparseModel(model, folder.path());
  EXPECT_INPUT_ERROR(ReadSparseModel(folder.path()), "stands in its track twice");
}

TEST(BadSparseModel, UnknownCameraModelOfALaterColmapIsRefused) {
  const TempFolder folder;
  WriteSparseModel(MakeSparseModel(), folder.path());
  std::string bytes = ReadBytes(folder / "cameras.bin");
  bytes[8 + 4] = 18;
  WriteBytes(folder / "cameras.bin", bytes);
  EXPECT_INPUT_ERROR(ReadSparseModel(folder.path()), "byte 8: camera 3 has the model id 18");
}

TEST(BadSparseModel, UnwritableOutputIsRefused) {
  const TempFolder folder;
  WriteBytes(folder / "file", "x");
  EXPECT_INPUT_ERROR(WriteSparseModel({}, folder / "file"), "is a file");
  fs::create_directories(folder / "model/points3D.bin");
  EXPECT_INPUT_ERROR(WriteSparseModel({}, folder / "model"), "is a folder");
  EXPECT_FALSE(fs::exists(folder / "model/cameras.bin")) << "half a model was left behind";
}

// Laws of the two functions that change a model.

Similarity TestSimilarity() {
  return {2.75, Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(), {10, -20, 30}};
}

TEST(TransformModel, KeepsEveryReprojectionError) {
  SparseModel model = MakeSparseModel();
  model.points.begin()->second.x_in_model.x() += 0.05;
  SparseModel moved = model;
  TransformModel(TestSimilarity(), &moved);
  const ReprojectionErrors before = UpdateReprojectionErrors(&model);
  const ReprojectionErrors after = UpdateReprojectionErrors(&moved);
  EXPECT_GT(before.mean_px, 0.01);
  EXPECT_NEAR(after.mean_px, before.mean_px, 1e-9);
  EXPECT_NEAR(after.rms_px, before.rms_px, 1e-9);
  for (const auto& [id, point] : model.points) {
    EXPECT_NEAR(moved.points.at(id).error, point.error, 1e-8);
  }
}

TEST(TransformModel, MovesPointsAndCentresAlike) {
  const SparseModel model = MakeSparseModel();
  SparseModel moved = model;
  TransformModel(TestSimilarity(), &moved);
  for (const auto& [id, image] : model.images) {
    const Eigen::Vector3d centre = image.cam_from_model.TargetOriginInSource();
    EXPECT_THAT(moved.images.at(id).cam_from_model.TargetOriginInSource(),
                IsNearMatrix(TestSimilarity() * centre, 1e-12));
  }
  for (const auto& [id, point] : model.points) {
    EXPECT_THAT(moved.points.at(id).x_in_model,
                IsNearMatrix(TestSimilarity() * point.x_in_model, 1e-12));
  }
}

TEST(TransformModel, IsUndoneByTheInverse) {
  const SparseModel model = MakeSparseModel();
  SparseModel moved = model;
  TransformModel(TestSimilarity(), &moved);
  TransformModel(TestSimilarity().Inverse(), &moved);
  for (const auto& [id, image] : model.images) {
    EXPECT_THAT(moved.images.at(id).cam_from_model, IsNearRigid(image.cam_from_model, 1e-7, 1e-12));
  }
  for (const auto& [id, point] : model.points) {
    EXPECT_THAT(moved.points.at(id).x_in_model, IsNearMatrix(point.x_in_model, 1e-12));
  }
}

TEST(UpdateReprojectionErrors, ExactModelHasNone) {
  SparseModel model = MakeSparseModel();
  const ReprojectionErrors errors = UpdateReprojectionErrors(&model);
  EXPECT_EQ(errors.num_observations, 75u);
  EXPECT_LT(errors.mean_px, 1e-10);
  EXPECT_LT(errors.rms_px, 1e-10);
}

TEST(UpdateReprojectionErrors, CountsWhatWasAdded) {
  SparseModel model = MakeSparseModel();
  SparsePoint& point = model.points.begin()->second;
  SparseImage& first = model.images.at(point.track[0].image_id);
  SparseImage& second = model.images.at(point.track[1].image_id);
  first.points2d[point.track[0].point2d_index] += Eigen::Vector2d(3, 4);    // 5 px
  second.points2d[point.track[1].point2d_index] += Eigen::Vector2d(-1, 0);  // 1 px
  const ReprojectionErrors errors = UpdateReprojectionErrors(&model);
  EXPECT_NEAR(point.error, 6.0 / 3, 1e-10);
  EXPECT_NEAR(errors.mean_px, 6.0 / 75, 1e-10);
  EXPECT_NEAR(errors.rms_px, std::sqrt(26.0 / 75), 1e-10);
}

TEST(UpdateReprojectionErrors, PointsBehindCountHalfTheDiagonalAndUnseenOnesNothing) {
  SparseModel model = MakeSparseModel();
  SparsePoint& point = model.points.begin()->second;
  point.x_in_model.z() = -50;
  SparsePoint& unseen = model.points[7];
  unseen.error = 3;
  const ReprojectionErrors errors = UpdateReprojectionErrors(&model);
  EXPECT_NEAR(point.error, 400, 1e-9);  // 640 x 480
  EXPECT_NEAR(errors.mean_px, 3 * 400.0 / 75, 1e-9);
  EXPECT_EQ(unseen.error, -1);
}

}  // namespace
}  // namespace roomtex
