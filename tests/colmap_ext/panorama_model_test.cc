#include "colmap_ext/panorama_model.h"

#include <random>

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/frames.h"
#include "core/panorama_faces.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Panoramas of points all around, and the model that COLMAP would make of their faces: each face
// with a little error of its own.
class FacesOfPanoramas : public testing::Test {
 protected:
  static constexpr int kNumPanoramas = 4;

  void SetUp() override {
    const std::vector<Eigen::Quaterniond> rotations = FaceRotations(options_);
    for (int p = 0; p < kNumPanoramas; ++p) {
      truth_.push_back({Eigen::Quaterniond(1, 0.1 * p, 0.4 * p, -0.05).normalized(),
                        Eigen::Vector3d(0.5 * p, 0.1, 0.3 * p * p)});
      CutPanorama panorama;
      panorama.name = "pano_" + std::to_string(p) + ".jpg";
      panorama.width = 2000;
      panorama.height = 1000;
      panorama.face_camera = FaceCamera(panorama.PanoramaCamera(), options_);
      for (size_t k = 0; k < rotations.size(); ++k) {
        panorama.faces.push_back(
            {"pano_" + std::to_string(p) + "/face_" + std::to_string(k + 1) + ".jpg",
             rotations[k]});
      }
      panoramas_.push_back(panorama);
    }
    faces_.cameras[1] = panoramas_[0].face_camera;
    faces_.cameras[1].camera_id = 1;
    for (int p = 0; p < kNumPanoramas; ++p) {
      for (size_t k = 0; k < rotations.size(); ++k) {
        SparseImage& image = faces_.images[10 * p + static_cast<uint32_t>(k) + 1];
        image.image_id = 10 * p + static_cast<uint32_t>(k) + 1;
        image.camera_id = 1;
        image.name = panoramas_[p].faces[k].name;
        const Rigid off{
            Eigen::Quaterniond(1, Gaussian(5e-4), Gaussian(5e-4), Gaussian(5e-4)).normalized(),
            0.005 * Eigen::Vector3d(Gaussian(1), Gaussian(1), Gaussian(1))};
        image.cam_from_model = off * Rigid{rotations[k], Eigen::Vector3d::Zero()} * truth_[p];
      }
    }
    for (uint64_t id = 1; id <= 400; ++id) AddPoint(id, rotations);
  }

  double Gaussian(double sigma) { return sigma * std::normal_distribution<double>()(random_); }

  void AddPoint(uint64_t id, const std::vector<Eigen::Quaterniond>& rotations) {
    const CameraProjection camera(faces_.cameras.at(1));
    const Eigen::Vector3d direction(Gaussian(1), Gaussian(0.5), Gaussian(1));
    const Eigen::Vector3d x = 4 * direction.normalized();
    SparsePoint& point = faces_.points[id];
    point.x_in_model = x + 0.01 * Eigen::Vector3d(Gaussian(1), Gaussian(1), Gaussian(1));
    for (auto& [image_id, image] : faces_.images) {
      const int p = static_cast<int>(image_id / 10);
      const Eigen::Quaterniond& rotation = rotations[image_id % 10 - 1];
      const auto at = camera.ImgFromCam(rotation * (truth_[p] * x));
      if (!at || !camera.InImage(*at)) continue;
      point.track.push_back({image_id, static_cast<uint32_t>(image.points2d.size())});
      image.points2d.push_back(*at);
      image.point3d_ids.push_back(id);
    }
  }

  std::mt19937 random_{3};
  FaceOptions options_;
  std::vector<Rigid> truth_;  // panorama_from_model
  std::vector<CutPanorama> panoramas_;
  SparseModel faces_;
};

TEST_F(FacesOfPanoramas, BecomePanoramasWithOnePoseEach) {
  std::vector<std::string> warnings;
  const SparseModel merged = MergeFaces(faces_, panoramas_, "panoramas.json", &warnings);
  EXPECT_THAT(warnings, IsEmpty());
  ASSERT_EQ(merged.images.size(), 4u);
  ASSERT_EQ(merged.cameras.size(), 1u);
  EXPECT_TRUE(merged.cameras.begin()->second.IsPanorama());
  // Observations are exact, so that the adjustment finds the truth but for one similarity: angles
  // between the panoramas, and the ratios of their distances.
  SparseModel errors = merged;
  EXPECT_LT(UpdateReprojectionErrors(&errors).rms_px, 0.01);
  const auto pose = [&](int p) {
    return merged.FindImage("pano_" + std::to_string(p) + ".jpg")->cam_from_model;
  };
  const auto distance = [](const Rigid& a, const Rigid& b) {
    return (a.TargetOriginInSource() - b.TargetOriginInSource()).norm();
  };
  const double scale = distance(pose(0), pose(1)) / distance(truth_[0], truth_[1]);
  for (int p = 1; p < kNumPanoramas; ++p) {
    EXPECT_LT(RotationAngle(pose(p).rotation * pose(0).rotation.conjugate(),
                            truth_[p].rotation * truth_[0].rotation.conjugate()),
              1e-5);
    EXPECT_NEAR(distance(pose(0), pose(p)) / distance(truth_[0], truth_[p]) / scale, 1, 1e-4);
  }
  // A point that two faces see stands once in their panorama.
  for (const auto& [id, point] : merged.points) {
    std::set<uint32_t> seen;
    for (const TrackElement& element : point.track) {
      EXPECT_TRUE(seen.insert(element.image_id).second);
      EXPECT_EQ(merged.images.at(element.image_id).point3d_ids[element.point2d_index], id);
    }
  }
}

TEST_F(FacesOfPanoramas, AFaceRegisteredElsewhereIsNamedAndLeftOut) {
  faces_.images.at(13).cam_from_model.translation += Eigen::Vector3d(2, 0, 0);
  std::vector<std::string> warnings;
  const SparseModel merged = MergeFaces(faces_, panoramas_, "panoramas.json", &warnings);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("pano_1/face_3.jpg")));
  SparseModel errors = merged;
  EXPECT_LT(UpdateReprojectionErrors(&errors).rms_px, 0.01);
}

TEST_F(FacesOfPanoramas, OrdinaryPhotosStayAndAModelWithoutFacesIsRefused) {
  faces_.images.at(13).name = "photo.jpg";
  std::vector<std::string> warnings;
  const SparseModel merged = MergeFaces(faces_, panoramas_, "panoramas.json", &warnings);
  EXPECT_NE(merged.FindImage("photo.jpg"), nullptr);
  EXPECT_EQ(merged.images.size(), 5u);
  for (auto& [id, image] : faces_.images) image.name += ".png";
  EXPECT_INPUT_ERROR(MergeFaces(faces_, panoramas_, "panoramas.json", &warnings), "panoramas.json");
}

TEST_F(FacesOfPanoramas, PanoramasJsonComesBackAsItWasWritten) {
  const TempFolder folder;
  WritePanoramaSet(panoramas_, folder / "panoramas.json");
  const std::vector<CutPanorama> back = ReadPanoramaSet(folder / "panoramas.json");
  ASSERT_EQ(back.size(), panoramas_.size());
  EXPECT_EQ(back[2].name, "pano_2.jpg");
  EXPECT_EQ(back[2].face_camera.params, panoramas_[2].face_camera.params);
  ASSERT_EQ(back[2].faces.size(), 8u);
  EXPECT_LT(
      RotationAngle(back[2].faces[3].face_from_panorama, panoramas_[2].faces[3].face_from_panorama),
      1e-12);
  WriteBytes(folder / "broken.json", "{\"format\": \"roomtex panoramas 1\", \"panoramas\": [1]}");
  EXPECT_INPUT_ERROR(ReadPanoramaSet(folder / "broken.json"), "is not as roomtex-import writes it");
}

}  // namespace
}  // namespace roomtex
