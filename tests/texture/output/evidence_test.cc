#include "texture/output/evidence.h"

#include <cmath>

#include <gmock/gmock.h>

#include "core/error.h"
#include "tests/support/ply_vertices.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/view/view_scene.h"
#include "texture/tone/exposure.h"
#include "texture/view/view_evidence.h"

namespace roomtex {
namespace {

Scan ScanWithHole() {
  Scan scan = TwoWallsScan(50, 40);
  scan.points[3] = Scan::MissingPoint();
  return scan;
}

TEST(Evidence, ComesBackInTheOrderOfTheModel) {
  const TempFolder folder;
  const Scan scan = ScanWithHole();
  WriteViewFolder(scan, folder.path());
  const Evidence evidence = ReadEvidence(folder / "evidence.ply");
  const PlyVertices model = ParsePlyVertices(ReadBytes(folder / "model.ply"), "model.ply");
  ASSERT_EQ(evidence.points.size(), 50u * 40 - 1);
  ASSERT_EQ(model.points.size(), evidence.points.size());
  const ColoredScan colored = ColorForView(scan);
  for (size_t i = 0; i < evidence.points.size(); ++i) {
    const size_t sample = i < 3 ? i : i + 1;
    EXPECT_EQ(evidence.points[i].cast<float>(), model.points[i]);
    EXPECT_EQ(evidence.views[i], model.views[i]);
    EXPECT_EQ(evidence.intensity[i], scan.intensity[sample]);
    if (std::isnan(colored.disagreement[sample])) {
      EXPECT_TRUE(std::isnan(evidence.disagreement[i]));
    } else {
      EXPECT_EQ(evidence.disagreement[i], colored.disagreement[sample]);
    }
  }
}

TEST(Evidence, RefusesOtherFilesAndTruncatedOnes) {
  const TempFolder folder;
  WriteViewFolder(ScanWithHole(), folder.path());
  EXPECT_INPUT_ERROR(ReadEvidence(folder / "model.ply"), "is not the evidence");
  const std::string bytes = ReadBytes(folder / "evidence.ply");
  for (size_t size = 0; size < bytes.size(); size += 1 + size / 5) {
    WriteBytes(folder / "cut.ply", bytes.substr(0, size));
    EXPECT_THROW(ReadEvidence(folder / "cut.ply"), InputError) << size;
  }
}

TEST(Evidence, DisagreementOfSamplesSumsUpToTheReportedOne) {
  ObservationStore store(3, 4);
  const auto see = [&store](size_t sample, int photo, float light) {
    Observation o;
    o.color = PackColor(Eigen::Vector3f(light, 0.5f * light, 0.2f));
    o.weight = PackWeight(1);
    o.photo = static_cast<uint16_t>(photo) & 0x7fff;
    store.Add(sample, o);
  };
  see(0, 0, 0.2f);
  see(0, 1, 0.3f);
  see(1, 0, 0.1f);
  see(1, 1, 0.4f);
  see(1, 2, 0.5f);
  see(2, 2, 0.5f);
  const std::vector<Eigen::Vector3f> gains = {
      Eigen::Vector3f(1, 1, 1), Eigen::Vector3f(0.7f, 0.8f, 0.9f), Eigen::Vector3f(1.1f, 1, 1)};
  const float two = SampleDisagreement(store.Begin(0), store.Count(0), gains);
  const float three = SampleDisagreement(store.Begin(1), store.Count(1), gains);
  EXPECT_GT(two, 1);
  EXPECT_TRUE(std::isnan(SampleDisagreement(store.Begin(2), store.Count(2), gains)));
  EXPECT_NEAR(MeasureDisagreement(store, gains).after, (two + 3 * three) / 4, 1e-4);
}

TEST(ViewEvidence, FindsThePointsOfTheModelInTheGlb) {
  const TempFolder folder;
  Scan scan = ScanWithHole();
  for (Eigen::Vector3d& p : scan.points) p += Eigen::Vector3d(300, -200, 100);  // floats round
  WriteViewFolder(scan, folder.path(), 256);
  const ViewModel model = ReadViewModel(folder.path());
  const Evidence evidence = ReadEvidence(folder / "evidence.ply");
  const Eigen::Vector3d origin = model.origin;
  const ViewChunks chunks(model);
  const ViewEvidence view(chunks, origin, evidence, 2);
  EXPECT_EQ(view.ToJson()["available"], true);
  EXPECT_EQ(view.ToJson()["max_views"], 3);
  const std::vector<Eigen::Vector3f> points = chunks.Read(0).points;
  const std::string codes = view.Encode(0, chunks.Make(0, ViewChunks::kFull)->points);
  ASSERT_EQ(codes.size(), 4 * points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    size_t nearest = 0;
    double distance = 1e9;
    for (size_t k = 0; k < evidence.points.size(); ++k) {
      const double d = (evidence.points[k] - origin - points[i].cast<double>()).norm();
      if (d < distance) nearest = k, distance = d;
    }
    ASSERT_LT(distance, 1e-4);
    ASSERT_EQ(static_cast<uint8_t>(codes[4 * i + 1]), evidence.views[nearest]);
    const float difference = evidence.disagreement[nearest];
    ASSERT_EQ(static_cast<uint8_t>(codes[4 * i + 2]),
              std::isnan(difference) ? 255 : std::lround(4 * difference));
    ASSERT_EQ(codes[4 * i + 3], 0);
  }
}

TEST(ViewEvidence, SaysWhenItBelongsToAnotherModel) {
  const TempFolder folder;
  WriteViewFolder(ScanWithHole(), folder.path());
  const ViewModel model = ReadViewModel(folder.path());
  Evidence evidence = ReadEvidence(folder / "evidence.ply");
  for (Eigen::Vector3d& p : evidence.points) p.x() += 0.5;
  const Json json = ViewEvidence(ViewChunks(model), model.origin, evidence, 1).ToJson();
  EXPECT_EQ(json["available"], false);
  EXPECT_THAT(json["reason"].get<std::string>(), testing::HasSubstr("another model"));
}

}  // namespace
}  // namespace roomtex
