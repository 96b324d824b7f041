#include "align/surveyed_scans.h"

#include <thread>

#include <gmock/gmock.h>

#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

TEST(SurveyedScans, MakesEachFormOnceWhoeverAsksFirst) {
  const SimulatedCase& one = MakeCase();
  const SurveyedScans surveyed(one.scans);
  const ScanPatches* patches[2] = {};
  const ScanViewer* viewers[2] = {};
  const auto ask = [&](int who) {
    patches[who] = &surveyed.patches();
    viewers[who] = &surveyed.viewer();
  };
  std::thread other(ask, 1);
  ask(0);
  other.join();
  EXPECT_EQ(patches[0], patches[1]);
  EXPECT_EQ(viewers[0], viewers[1]);
  EXPECT_EQ(&viewers[0]->free_space(), &surveyed.free_space());
  EXPECT_EQ(&surveyed.meshes(), &surveyed.meshes());
  EXPECT_EQ(&surveyed.planes(), &surveyed.planes());
  EXPECT_EQ(&surveyed.scans(), &one.scans);
  ASSERT_EQ(surveyed.meshes().size(), 1u);
  EXPECT_EQ(surveyed.meshes()[0].size(), BuildScanMesh(one.scans[0], ScanMeshOptions()).size());
}

TEST(SurveyedScans, MeasuresDistancesFromTheNearestSample) {
  const SimulatedCase& one = MakeCase();
  const SurveyedScans surveyed(one.scans);
  const Scan& scan = one.scans[0];
  const Eigen::Vector3d sample = scan.points[scan.Index(scan.num_columns / 3, scan.num_rows / 2)];
  ASSERT_TRUE(sample.allFinite());
  const std::vector<double> distance =
      surveyed.DistancesOf({sample, sample - 0.3 * sample.normalized(), {100, 0, 0}});
  EXPECT_EQ(distance[0], 0);
  EXPECT_GT(distance[1], 0.05);
  EXPECT_LE(distance[1], 0.3 + 1e-12);
  EXPECT_GT(distance[2], 80);
  const std::vector<Scan> none(1);
  EXPECT_TRUE(std::isinf(SurveyedScans(none).DistancesOf({sample})[0]));
}

}  // namespace
}  // namespace roomtex
