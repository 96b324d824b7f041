#include "building/outline_proposal.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/frames.h"
#include "tests/building/simulated_street.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

struct Result {
  OutlineProposal proposal;
  UpFinding up;
  StreetErrors errors;
};

Result ProposeFor(const SimulatedStreet& street, OutlineInputOptions input,
                  const Similarity& input_from_truth = {}, int num_threads = -1) {
  const TempFolder folder;
  SparseModel model = street.model;
  TransformModel(input_from_truth, &model);
  WriteSparseModel(model, folder / "model");
  input.input_path = folder / "model";
  OutlineCloud cloud = ReadOutlineCloud(input, num_threads);
  std::vector<PlaneSegment> segments = FindPlaneSegments(cloud, 0, num_threads);
  Result result;
  result.up = Level(&cloud, &segments);
  result.proposal = ProposeOutline(cloud, segments, {});
  result.errors = CompareStreet(street.truth, result.proposal.outline,
                                cloud.frame.outline_from_input * input_from_truth);
  return result;
}

OutlineInputOptions Metres() {
  OutlineInputOptions input;
  input.scale = 1;
  return input;
}

void ExpectExact(const Result& result, double corner, double height) {
  EXPECT_EQ(result.errors.missed, 0);
  EXPECT_LT(result.errors.corner, corner);
  EXPECT_LT(result.errors.ground, height);
  EXPECT_LT(result.errors.eaves, height);
  EXPECT_LT(result.errors.ridge, height);
  EXPECT_LT(result.errors.volume_share, 0.02);
}

// From 20 m, where points are 4 cm off: footprints and heights within 10 cm, in fact within 5.
TEST(OutlineProposal, FindsFourHousesOfAStreet) {
  for (int seed = 1; seed <= 3; ++seed) {
    StreetOptions options;
    options.seed = seed;
    const Result result = ProposeFor(MakeStreet(options), Metres());
    EXPECT_EQ(result.proposal.outline.buildings.size(), 4u);
    ExpectExact(result, 0.05, 0.05);
    EXPECT_GT(result.proposal.explained, 0.7);
    for (size_t i = 0; i < 4; ++i) {
      EXPECT_TRUE(result.proposal.evidence[i].doubts.empty());
      for (const double sigma : result.proposal.evidence[i].corner_sigma) EXPECT_LT(sigma, 0.05);
    }
    const std::vector<OutlineBuilding>& found = result.proposal.outline.buildings;
    EXPECT_EQ(found[0].RoofShape(), "flat");
    EXPECT_EQ(found[1].RoofShape(), "gable");
    EXPECT_EQ(found[2].RoofShape(), "shed");
    EXPECT_EQ(found[3].footprint.size(), 6u);
  }
}

TEST(OutlineProposal, FindsTheMockUpOfBoxes) {
  StreetOptions options;
  options.mock_up = true;
  const Result result = ProposeFor(MakeStreet(options), Metres());
  EXPECT_EQ(result.proposal.outline.buildings.size(), 2u);
  ExpectExact(result, 0.002, 0.002);
}

// COLMAP's frame: any origin, rotation and scale.
TEST(OutlineProposal, DoesNotHangOnTheFrameOfTheModel) {
  const SimulatedStreet street = MakeStreet({});
  const Similarity input_from_truth{
      0.137, Eigen::Quaterniond(0.4, -0.5, 0.7, 0.2).normalized(), {12, -3, 40}};
  const Result result = ProposeFor(street, {}, input_from_truth);
  EXPECT_FALSE(result.proposal.outline.metric);
  EXPECT_TRUE(result.up.trusted);
  EXPECT_EQ(result.up.source, "cameras");
  EXPECT_EQ(result.proposal.outline.buildings.size(), 4u);
  ExpectExact(result, 0.06, 0.06);
}

TEST(OutlineProposal, SaysWhatItDidNotSee) {
  StreetOptions options;
  options.bare_house = 1;  // the rear wall
  Result result = ProposeFor(MakeStreet(options), Metres());
  EXPECT_EQ(result.errors.missed, 0);
  ASSERT_EQ(result.proposal.evidence.size(), 4u);
  EXPECT_FALSE(result.proposal.evidence[1].doubts.empty());
  EXPECT_TRUE(result.proposal.evidence[0].doubts.empty());

  options = {};
  options.photos_from_above = false;
  result = ProposeFor(MakeStreet(options), Metres());
  for (size_t i = 0; i < result.proposal.evidence.size(); ++i) {
    const BuildingEvidence& evidence = result.proposal.evidence[i];
    EXPECT_EQ(evidence.num_roof_points == 0, !evidence.doubts.empty());
  }
}

TEST(OutlineProposal, IsTheSameForAnyNumberOfThreads) {
  const SimulatedStreet street = MakeStreet({});
  EXPECT_EQ(OutlineToJson(ProposeFor(street, Metres(), {}, 1).proposal.outline),
            OutlineToJson(ProposeFor(street, Metres(), {}, 4).proposal.outline));
}

TEST(OutlineProposal, KeepsToTheArea) {
  const TempFolder folder;
  WriteSparseModel(MakeStreet({}).model, folder / "model");
  OutlineInputOptions input = Metres();
  input.input_path = folder / "model";
  input.up = "0,0,1";
  OutlineCloud cloud = ReadOutlineCloud(input, -1);
  std::vector<PlaneSegment> segments = FindPlaneSegments(cloud, 0, -1);
  Level(&cloud, &segments);
  ProposalOptions options;
  options.area = "-3,-4,12.5,12";
  const OutlineProposal proposal = ProposeOutline(cloud, segments, options);
  ASSERT_EQ(proposal.outline.buildings.size(), 1u);
  EXPECT_NEAR(PolygonArea(proposal.outline.buildings[0].footprint), 80, 1);
}

// A dense cloud without cameras, in metres and upright as clouds are.
TEST(OutlineProposal, FindsTheStreetInADenseCloud) {
  const TempFolder folder;
  StreetOptions options;
  WriteCloud(MakeDenseStreet(options, 300000), folder / "dense.ply");
  OutlineInputOptions input;
  input.input_path = folder / "dense.ply";
  OutlineCloud cloud = ReadOutlineCloud(input, -1);
  EXPECT_LE(cloud.points.size(), kMaxOutlinePoints);
  std::vector<PlaneSegment> segments = FindPlaneSegments(cloud, 0, -1);
  const UpFinding up = Level(&cloud, &segments);
  EXPECT_EQ(up.source, "file");
  Result result;
  result.proposal = ProposeOutline(cloud, segments, {});
  result.errors = CompareStreet(MakeStreet(options).truth, result.proposal.outline,
                                cloud.frame.outline_from_input);
  EXPECT_EQ(result.proposal.outline.buildings.size(), 4u);
  ExpectExact(result, 0.05, 0.05);
}

// Nor on where its origin lies, not even for the windows in its walls.
TEST(OutlineProposal, IsTheSameFarFromTheOrigin) {
  const TempFolder folder;
  WriteCloud(MakeDenseStreet({}, 120000), folder / "dense.ply");
  OutlineInputOptions input;
  input.input_path = folder / "dense.ply";
  const OutlineCloud cloud = ReadOutlineCloud(input, -1);
  const auto footprints_at = [&](const Eigen::Vector3d& place) {
    OutlineCloud moved = cloud;
    for (Eigen::Vector3d& x : moved.points) x += place;
    std::vector<PlaneSegment> segments = FindPlaneSegments(moved, 0, -1);
    Level(&moved, &segments);
    std::vector<std::vector<Eigen::Vector2d>> footprints;
    for (const OutlineBuilding& building : ProposeOutline(moved, segments, {}).outline.buildings) {
      footprints.push_back(building.footprint);
      for (Eigen::Vector2d& x : footprints.back()) x -= place.head<2>();
    }
    return footprints;
  };
  const auto here = footprints_at({0, 0, 0});
  ASSERT_EQ(here.size(), 4u);
  for (const Eigen::Vector3d& place :
       {Eigen::Vector3d(3000, 4000, 0), Eigen::Vector3d(686000, 5330000, 500)}) {
    const auto there = footprints_at(place);
    ASSERT_EQ(there.size(), here.size());
    for (size_t i = 0; i < here.size(); ++i) {
      ASSERT_EQ(there[i].size(), here[i].size()) << "building " << i + 1;
      for (size_t k = 0; k < here[i].size(); ++k) {
        EXPECT_LT((there[i][k] - here[i][k]).norm(), 0.02) << "building " << i + 1;
      }
    }
  }
}

// Doubtful buildings are those that are edited: what is proposed of a street that lies on its side
// can be read, too.
TEST(OutlineProposal, CanAlwaysBeReadAgain) {
  const TempFolder folder;
  StreetOptions options;
  options.seed = 2;  // two corners of its second building are less than a micrometre apart
  std::vector<Eigen::Vector3d> points = MakeDenseStreet(options, 120000);
  for (Eigen::Vector3d& x : points) x = Eigen::Vector3d(x.x(), -x.z(), x.y());
  WriteCloud(points, folder / "side.ply");
  OutlineInputOptions input;
  input.input_path = folder / "side.ply";
  OutlineCloud cloud = ReadOutlineCloud(input, -1);
  std::vector<PlaneSegment> segments = FindPlaneSegments(cloud, 0, -1);
  Level(&cloud, &segments);
  const Outline outline = ProposeOutline(cloud, segments, {}).outline;
  EXPECT_GT(outline.buildings.size(), 0u);
  WriteOutline(folder / "outline.json", outline, true);
  EXPECT_EQ(OutlineToJson(ReadOutline(folder / "outline.json")), OutlineToJson(outline));
}

// In a map grid, millions of metres from its origin, walls that correct what is up lift nothing.
TEST(OutlineProposal, LevellingLeavesACloudWhereItLies) {
  const TempFolder folder;
  WriteCloud(MakeDenseStreet({}, 100000), folder / "dense.ply");
  OutlineInputOptions input;
  input.input_path = folder / "dense.ply";
  OutlineCloud cloud = ReadOutlineCloud(input, -1);
  const Eigen::Quaterniond tilt(
      Eigen::AngleAxisd(RadFromDeg(0.1), Eigen::Vector3d(1, 2, 0).normalized()));
  for (Eigen::Vector3d& x : cloud.points) x = tilt * x + Eigen::Vector3d(691000, 5334000, 520);
  std::vector<PlaneSegment> segments = FindPlaneSegments(cloud, 0, -1);
  const Eigen::Vector3d middle = MiddleOf(cloud.points);
  const UpFinding up = Level(&cloud, &segments);
  EXPECT_NEAR(DegFromRad(std::acos(up.up_in_input.z())), 0.1, 0.03);
  EXPECT_LT((cloud.frame.outline_from_input * middle - middle).norm(), 0.01);
}

}  // namespace
}  // namespace roomtex
