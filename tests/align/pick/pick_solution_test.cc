#include "align/pick/pick_solution.h"

#include <gmock/gmock.h>

#include "core/text.h"
#include "tests/align/model_part.h"
#include "tests/align/pick/pick_room.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using Status = PickState::Status;

PickSolution Solve(const std::vector<SessionPick>& picks) {
  return PickSolver(ThePickRoom().scene()).Solve(picks);
}

std::vector<SessionPick> TruePicks(int count) {
  return ThePickRoom().Picks(ThePickRoom().clicked_photo(), count);
}
std::string ClickedName() { return ThePickRoom().room().PhotoName(ThePickRoom().clicked_photo()); }

// All poses of the model are where they truly are.
void ExpectTruePoses(const PickSolution& solution, double metres) {
  const SimulatedRoom& room = ThePickRoom().room();
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const PhotoState& state = solution.photos.at(room.PhotoName(photo));
    ASSERT_TRUE(state.solved()) << photo;
    EXPECT_THAT(state.cam_from_scan, IsNearRigid(room.CamFromScan(photo), metres, metres)) << photo;
  }
}

TEST(PickSolution, SixTruePicksGiveTheTruthAndNoResiduals) {
  const PickSolution solution = Solve(TruePicks(6));
  const PhotoState& photo = solution.photos.at(ClickedName());
  EXPECT_EQ(photo.by, PhotoState::By::kPicks);
  EXPECT_EQ(photo.num_used, 6);
  EXPECT_LT(photo.rms_px, 1e-4);
  EXPECT_LT(photo.rms, 1e-6);
  EXPECT_FALSE(photo.ambiguous);
  EXPECT_THAT(photo.warnings, IsEmpty());
  ASSERT_TRUE(solution.models[0].scan_from_sparse);
  EXPECT_NEAR(
      solution.models[0].scan_from_sparse->scale / ThePickRoom().room().ScanFromSparse().scale, 1,
      1e-3);
  ExpectTruePoses(solution, 0.01);
  for (const PickState& pick : solution.picks) {
    EXPECT_EQ(pick.status, Status::kUsed);
    EXPECT_LT(pick.residual_px, 1e-3);
    EXPECT_LT(pick.leave_one_out_px, 1e-2);
    EXPECT_FALSE(pick.worst);  // none is worse than another
  }
  EXPECT_THAT(solution.next, HasSubstr("Enough picks"));
}

TEST(PickSolution, ThreeToFivePicksAreDecidedByTheSparseModel) {
  for (const int count : {3, 4, 5}) {
    const PickSolution solution = Solve(TruePicks(count));
    const PhotoState& photo = solution.photos.at(ClickedName());
    EXPECT_EQ(photo.by, count == 3 ? PhotoState::By::kSparseModel : PhotoState::By::kPicks);
    EXPECT_FALSE(photo.ambiguous) << count;
    EXPECT_LT(photo.rms_px, 0.01) << count;
    EXPECT_THAT(
        photo.cam_from_scan,
        IsNearRigid(ThePickRoom().room().CamFromScan(ThePickRoom().clicked_photo()), 1e-4, 1e-4))
        << count;
    ExpectTruePoses(solution, 0.01);
    EXPECT_THAT(solution.next, HasSubstr(std::to_string(6 - count) + " more pair"));
  }
}

TEST(PickSolution, TwoPicksSayNothing) {
  const PickSolution solution = Solve(TruePicks(2));
  EXPECT_FALSE(solution.photos.at(ClickedName()).solved());
  EXPECT_FALSE(solution.models[0].scan_from_sparse);
  for (const PickState& pick : solution.picks) {
    EXPECT_EQ(pick.status, Status::kWaiting);
    EXPECT_TRUE(std::isnan(pick.residual_px));
  }
  EXPECT_THAT(Solve({}).next, HasSubstr("Click a point"));
}

TEST(PickSolution, AWrongPickIsNamedAndLeftOut) {
  std::vector<SessionPick> picks = TruePicks(8);
  *picks[3].x_in_img += Eigen::Vector2d(40, -25);
  const PickSolution solution = Solve(picks);
  for (size_t i = 0; i < picks.size(); ++i) {
    EXPECT_EQ(solution.picks[i].status, i == 3 ? Status::kBad : Status::kUsed) << i;
  }
  EXPECT_NEAR(solution.picks[3].residual_px, std::hypot(40, 25), 0.5);
  EXPECT_NEAR(solution.picks[3].error_px.x(), -40, 0.5);
  EXPECT_NEAR(solution.picks[3].leave_one_out_px, std::hypot(40, 25), 0.5);
  EXPECT_EQ(solution.photos.at(ClickedName()).num_used, 7);
  EXPECT_THAT(solution.photos.at(ClickedName()).warnings,
              Contains(HasSubstr("Pick 4 is left out")));
  EXPECT_THAT(solution.next, HasSubstr("pick 4"));
  ExpectTruePoses(solution, 0.01);
}

TEST(PickSolution, OfPicksThatMissALittleTheWorstIsMarked) {
  std::vector<SessionPick> picks = TruePicks(7);
  *picks[5].x_in_img += Eigen::Vector2d(3, 2);
  const PickSolution solution = Solve(picks);
  for (size_t i = 0; i < picks.size(); ++i) {
    EXPECT_EQ(solution.picks[i].status, Status::kUsed);
    EXPECT_EQ(solution.picks[i].worst, i == 5) << i;
  }
}

TEST(PickSolution, OfFivePicksTheWorstIsTheWrongOne) {
  // Which neither residuals nor bare left-out distances always tell: without it the others fit.
  for (int wrong = 0; wrong < 5; ++wrong) {
    std::vector<SessionPick> picks = TruePicks(5);
    *picks[wrong].x_in_img += Eigen::Vector2d(15, 20);
    const PickSolution solution = Solve(picks);
    for (int i = 0; i < 5; ++i) EXPECT_EQ(solution.picks[i].worst, i == wrong) << wrong;
    EXPECT_NEAR(solution.picks[wrong].leave_one_out_px, 25, 1);
  }
}

TEST(PickSolution, AGoodFourthPickNeverTakesThePoseAway) {
  // Also on one line with two of the three: there are several poses then, and the sparse model
  // tells.
  const PickRoom& room = ThePickRoom();
  const std::vector<SessionPick> all = room.SmoothPicks(room.clicked_photo(), 40);
  int tried = 0;
  for (size_t a = 0; a + 3 < all.size(); a += 3) {
    const std::vector<SessionPick> three(all.begin() + a, all.begin() + a + 3);
    const PickSolution by_three = Solve(three);
    if (!by_three.photos.at(ClickedName()).solved()) continue;
    ++tried;
    for (const double share : {0.0, 0.3, 0.5}) {
      std::vector<SessionPick> four = three;
      four.push_back(all[a + 3]);
      if (share > 0) {
        four[3].x_in_scan = (1 - share) * *three[0].x_in_scan + share * *three[1].x_in_scan;
        four[3].x_in_img = room.Project(room.clicked_photo(), *four[3].x_in_scan);
      }
      *four[3].x_in_img += Eigen::Vector2d(1.2, -0.9);
      const PickSolution by_four = Solve(four);
      EXPECT_TRUE(by_four.photos.at(ClickedName()).solved()) << a << " " << share;
      EXPECT_EQ(by_four.models[0].scan_from_sparse.has_value(),
                by_three.models[0].scan_from_sparse.has_value());
      EXPECT_LT((by_four.photos.at(ClickedName()).cam_from_scan.TargetOriginInSource() -
                 room.room().CamFromScan(room.clicked_photo()).TargetOriginInSource())
                    .norm(),
                0.3)
          << a << " " << share;
    }
  }
  EXPECT_GT(tried, 6);
}

TEST(PickSolution, PicksOfSeveralPhotosCountTogetherAsInTheAlignment) {
  const PickRoom& room = ThePickRoom();
  std::vector<SessionPick> picks;
  for (const int photo : {room.clicked_photo(), room.other_photo(), 5}) {
    for (const SessionPick& pick : room.SmoothPicks(photo, 2)) picks.push_back(pick);
  }
  const PickSolution solution = Solve(picks);
  ASSERT_TRUE(solution.models[0].scan_from_sparse);
  ExpectTruePoses(solution, 0.001);
  EXPECT_THAT(solution.next, HasSubstr("Enough picks"));
  for (const PickState& pick : solution.picks) EXPECT_LT(pick.leave_one_out_px, 0.1);
  picks[3].x_in_img->x() += 80;
  const PickSolution wrong = Solve(picks);
  EXPECT_EQ(wrong.picks[3].status, Status::kBad);
  ExpectTruePoses(wrong, 0.001);
  picks.pop_back();
  EXPECT_THAT(Solve(picks).next, HasSubstr("1 more pair"));
}

TEST(PickSolution, APickThatIsOffCountsForNothing) {
  std::vector<SessionPick> picks = TruePicks(7);
  *picks[2].x_in_img += Eigen::Vector2d(60, 0);
  picks[2].weight = 0;
  const PickSolution solution = Solve(picks);
  EXPECT_EQ(solution.picks[2].status, Status::kOff);
  EXPECT_NEAR(solution.picks[2].residual_px, 60, 0.1);  // but is measured
  EXPECT_LT(solution.photos.at(ClickedName()).rms_px, 1e-3);
  EXPECT_EQ(solution.photos.at(ClickedName()).num_complete, 7);
}

TEST(PickSolution, ExchangedPicksAreNamed) {
  std::vector<SessionPick> picks = TruePicks(7);
  std::swap(picks[1].x_in_img, picks[4].x_in_img);
  EXPECT_THAT(Solve(picks).photos.at(ClickedName()).warnings,
              Contains(HasSubstr("Picks 2 and 5 look exchanged")));
}

TEST(PickSolution, PicksAreNumberedAsTheyStandInTheList) {
  std::vector<SessionPick> picks = ThePickRoom().Picks(ThePickRoom().other_photo(), 1);
  for (const SessionPick& pick : TruePicks(9)) picks.push_back(pick);
  picks[2].weight = 0;
  *picks[6].x_in_img += Eigen::Vector2d(30, -40);
  const PickSolution solution = Solve(picks);
  EXPECT_EQ(solution.picks[6].status, Status::kBad);
  EXPECT_THAT(solution.photos.at(ClickedName()).warnings,
              Contains(HasSubstr("Pick 7 is left out")));
  EXPECT_THAT(solution.next, HasSubstr("pick 7"));
}

TEST(PickSolution, AMirroredScanIsNamedWithTheButton) {
  std::vector<SessionPick> picks = TruePicks(7);
  const Rigid& scan_from_station = ThePickRoom().scene().scans()[0].scan_from_station;
  const double factor = -1;
  for (SessionPick& pick : picks) {
    Eigen::Vector3d x = scan_from_station.Inverse() * *pick.x_in_scan;
    x.x() *= factor;
    pick.x_in_scan = scan_from_station * x;
  }
  const PickSolution solution = Solve(picks);
  EXPECT_THAT(solution.photos.at(ClickedName()).warnings,
              Contains(AllOf(HasSubstr("Press Mirror"), Not(HasSubstr("--")))));
}

TEST(PickSolution, PicksOnOneLineAreRefusedInASentence) {
  std::vector<SessionPick> picks = TruePicks(1);
  const Eigen::Vector3d start = *picks[0].x_in_scan;
  for (int i = 1; i < 6; ++i) {
    SessionPick pick = picks[0];
    pick.x_in_scan = start + 0.1 * i * Eigen::Vector3d(0.3, 1, 0.2);
    pick.x_in_img = *picks[0].x_in_img + Eigen::Vector2d(20.0 * i, 40.0 * i);
    picks.push_back(pick);
  }
  const PickSolution solution = Solve(picks);
  const PhotoState& photo = solution.photos.at(ClickedName());
  EXPECT_FALSE(photo.solved());
  EXPECT_THAT(photo.warnings, Contains(HasSubstr("lie on one straight line")));
}

TEST(PickSolution, TheMissingPartnerOfAHalfPairIsPredicted) {
  const std::vector<SessionPick> all = ThePickRoom().SmoothPicks(ThePickRoom().clicked_photo(), 8);
  ASSERT_EQ(all.size(), 8u);
  std::vector<SessionPick> picks = all;
  picks[6].x_in_img.reset();
  picks[7].x_in_scan.reset();
  picks[7].spot.reset();
  const PickSolution solution = Solve(picks);
  EXPECT_EQ(solution.picks[6].status, Status::kHalf);
  ASSERT_TRUE(solution.picks[6].predicted_img);
  EXPECT_THAT(*solution.picks[6].predicted_img, IsNearMatrix(*all[6].x_in_img, 0.01));
  ASSERT_TRUE(solution.picks[7].predicted_spot);
  EXPECT_LT((solution.picks[7].predicted_point - *all[7].x_in_scan).norm(), 1e-3);
  EXPECT_LT((solution.picks[7].predicted_spot->place - all[7].spot->place).norm(), 0.1);
  // Also in a photo without a pick of its own.
  const int other = ThePickRoom().other_photo();
  SessionPick half = ThePickRoom().SmoothPicks(other, 1)[0];
  const Eigen::Vector2d truth = *half.x_in_img;
  half.x_in_img.reset();
  picks.push_back(half);
  const PickSolution with_other = Solve(picks);
  ASSERT_TRUE(with_other.picks[8].predicted_img);
  EXPECT_LT((*with_other.picks[8].predicted_img - truth).norm(), 1);
}

// The same picks through roomtex-align's code.
std::vector<Pick> AsInAFile(const std::vector<SessionPick>& session_picks) {
  std::vector<Pick> picks;
  for (const SessionPick& pick : session_picks) {
    picks.push_back({pick.image_name, *pick.x_in_img, *pick.x_in_scan,
                     2 + static_cast<long>(picks.size()), pick.weight});
  }
  return picks;
}

Alignment Align(const std::vector<SessionPick>& session_picks) {
  const PickScene& scene = ThePickRoom().scene();
  const std::vector<Pick> picks = AsInAFile(session_picks);
  const SurveyedScans surveyed(scene.scans());
  AlignmentOptions options;
  options.plane_constrained = false;
  Progress progress(true);
  return AlignToScan({scene.models()[0], surveyed, picks, "picks.csv", "clockwise"}, options,
                     &progress);
}

void ExpectSameNumbers(const PickSolution& solution, const Alignment& alignment) {
  const AlignmentStart& start = alignment.start;
  EXPECT_NEAR(solution.models[0].rms_px, start.pick_rms_px, 1e-9);
  EXPECT_NEAR(solution.models[0].scan_from_sparse->scale, start.scan_from_sparse.scale, 1e-6);
  EXPECT_EQ(solution.models[0].scale.num_features, start.scale.num_features);
  for (size_t i = 0; i < solution.picks.size(); ++i) {
    EXPECT_NEAR(solution.picks[i].residual_px, start.picks[i].residual_px, 1e-9) << i;
    EXPECT_EQ(solution.picks[i].status == Status::kUsed, start.picks[i].used) << i;
  }
}

std::vector<SessionPick> WithNoise(std::vector<SessionPick> picks) {
  for (size_t i = 0; i < picks.size(); ++i) {
    *picks[i].x_in_img += 1.5 * Eigen::Vector2d(std::sin(7.0 * i), std::cos(3.0 * i));
  }
  return picks;
}

TEST(PickSolution, NumbersAreThoseOfTheAlignment) {
  const std::vector<SessionPick> picks = WithNoise(TruePicks(8));
  const PickSolution solution = Solve(picks);
  const Alignment alignment = Align(picks);
  ExpectSameNumbers(solution, alignment);
  for (size_t i = 0; i < picks.size(); ++i) {
    EXPECT_NEAR(solution.picks[i].leave_one_out_px, alignment.start.picks[i].leave_one_out_px,
                1e-9);
  }
  EXPECT_NEAR(solution.photos.at(ClickedName()).position_sigma, alignment.start.position_sigma,
              1e-12);
}

TEST(PickSolution, NumbersOfPicksInTwoPhotosAreThoseOfTheAlignment) {
  std::vector<SessionPick> picks = WithNoise(TruePicks(7));
  for (const SessionPick& pick : WithNoise(ThePickRoom().Picks(ThePickRoom().other_photo(), 3))) {
    picks.push_back(pick);
  }
  *picks.back().x_in_img += Eigen::Vector2d(30, -20);  // a bad one
  const PickSolution solution = Solve(picks);
  ExpectSameNumbers(solution, Align(picks));
  EXPECT_EQ(solution.picks.back().status, Status::kBad);
  EXPECT_EQ(solution.models[0].num_clicked_photos, 2);
}

void ExpectSameBits(const Similarity& a, const Similarity& b) {
  EXPECT_EQ(a.scale, b.scale);
  EXPECT_EQ(a.rotation.coeffs(), b.rotation.coeffs());
  EXPECT_EQ(a.translation, b.translation);
}

// Window and command ask the same function. Only the scale is measured on another form of the same
// mesh (a caster of all of it, and of what the photo sees): a ray meets it 1e-7 off.
TEST(PickSolution, SixPicksGiveTheSimilarityOfTheAlignment) {
  const std::vector<SessionPick> picks = WithNoise(TruePicks(6));
  const PickScene& scene = ThePickRoom().scene();
  const Similarity by_window = Solve(picks).models[0].scan_from_sparse.value();
  const Alignment alignment = Align(picks);
  Similarity by_command = alignment.start.scan_from_sparse;
  EXPECT_NEAR(by_command.scale / by_window.scale, 1, 1e-6);
  EXPECT_EQ(by_command.rotation.coeffs(), by_window.rotation.coeffs());
  // With the command's views and the window's scale, to the last bit.
  const std::vector<Pick> as_in_file = AsInAFile(picks);
  const PickStart found = StartFromPicks(
      scene.models()[0], as_in_file,
      ReviewViews(scene.models()[0], as_in_file, PickReviewOptions()), {}, AlignmentOptions(),
      [&](const SparseImage& image, const Rigid& cam_from_scan, const ScaleOptions& options) {
        return EstimateScale(scene.models()[0], image, cam_from_scan, scene.rays()->caster(),
                             options, 1);
      });
  ExpectSameBits(found.start.value().scan_from_sparse, by_window);
  // And with the window's own scale estimate on the command's mesh.
  const SurveyedScans surveyed(scene.scans());
  const PickStart on_mesh = StartFromPicks(
      scene.models()[0], as_in_file,
      ReviewViews(scene.models()[0], as_in_file, PickReviewOptions()), {}, AlignmentOptions(),
      [&](const SparseImage& image, const Rigid& cam_from_scan, const ScaleOptions& options) {
        return EstimateScale(scene.models()[0], image, cam_from_scan, scene.scans(),
                             surveyed.meshes(), options);
      });
  ExpectSameBits(on_mesh.start.value().scan_from_sparse, by_command);
}

// The same room without its sparse model: photos alone, their camera told or to be found.
std::unique_ptr<PickScene> PhotosAlone(const PhotoCameraOptions& camera) {
  PickSceneInput input = ThePickRoom().input();
  input.input_paths.clear();
  input.camera = camera;
  Progress progress(true);
  auto scene = std::make_unique<PickScene>(input, &progress);
  scene->Prepare();
  scene->WaitForEdges([] { return false; });
  return scene;
}

// The same room with its photos in two sparse models, the second in a frame of its own.
std::unique_ptr<PickScene> TwoModels() {
  const SimulatedRoom& room = ThePickRoom().room();
  const std::string other = room.PhotoName(ThePickRoom().other_photo());
  const SparseModel whole = room.MakeSparseModel(1500, 0.0);
  // Every other photo, so that the clicked one and this one are in different models.
  const auto in_second = [&](uint32_t id) {
    const std::string& name = whole.images.at(id).name;
    return name == other || (name != ClickedName() && id % 2 == 0);
  };
  const SparseModel first = PartOf(whole, [&](uint32_t id) { return !in_second(id); });
  SparseModel second = PartOf(whole, in_second);
  Similarity elsewhere;
  elsewhere.scale = 0.25;
  elsewhere.translation = {3, -2, 1};
  TransformModel(elsewhere, &second);
  PickSceneInput input = ThePickRoom().input();
  input.input_paths = {ThePickRoom().folder() / "first", ThePickRoom().folder() / "second"};
  WriteSparseModel(first, input.input_paths[0]);
  WriteSparseModel(second, input.input_paths[1]);
  Progress progress(true);
  auto scene = std::make_unique<PickScene>(input, &progress);
  scene->Prepare();
  scene->WaitForEdges([] { return false; });
  return scene;
}

TEST(PickSolution, OfSeveralModelsEachIsPlacedByThePicksInItsPhotos) {
  const auto scene = TwoModels();
  const std::string other = ThePickRoom().room().PhotoName(ThePickRoom().other_photo());
  ASSERT_EQ(scene->photos().size(), 8u);
  ASSERT_EQ(scene->FindPhoto(ClickedName())->model, 0);
  ASSERT_EQ(scene->FindPhoto(other)->model, 1);
  PickSolver solver(*scene);
  std::vector<SessionPick> picks = TruePicks(6);
  const PickSolution by_first = solver.Solve(picks);
  ASSERT_TRUE(by_first.models[0].scan_from_sparse);
  EXPECT_FALSE(by_first.models[1].scan_from_sparse);
  EXPECT_FALSE(by_first.photos.at(other).solved());
  EXPECT_THAT(by_first.next, HasSubstr("Enough picks"));
  EXPECT_THAT(by_first.next, HasSubstr("The photos of " + scene->ModelName(1) + " have no picks"));
  for (const SessionPick& pick : ThePickRoom().Picks(ThePickRoom().other_photo(), 6)) {
    picks.push_back(pick);
    if (picks.size() != 9) continue;
    const PickSolution begun = solver.Solve(picks);
    EXPECT_THAT(begun.next, HasSubstr("3 more pairs to go, in this photo or in others of " +
                                      scene->ModelName(1)));
  }
  const PickSolution solution = solver.Solve(picks);
  ExpectTruePoses(solution, 0.01);
  EXPECT_EQ(solution.models[0].num_clicked_photos, 1);
  EXPECT_EQ(solution.models[1].num_clicked_photos, 1);
  EXPECT_NEAR(solution.models[1].scan_from_sparse->scale * 0.25 /
                  solution.models[0].scan_from_sparse->scale,
              1, 1e-3);
  EXPECT_THAT(solution.next, Not(HasSubstr("have no picks")));
}

PhotoCameraOptions TrueCamera() {
  const Camera& camera = ThePickRoom().room().camera();
  PhotoCameraOptions options{CameraModelName(camera.model), ""};
  for (const double param : camera.params) {
    options.camera_params += (options.camera_params.empty() ? "" : ",") + Exact(param);
  }
  return options;
}

TEST(PickSolution, WithoutASparseModelAPhotoIsSolvedByItsOwnPicks) {
  const auto scene = PhotosAlone(TrueCamera());
  ASSERT_EQ(scene->photos().size(), 2u);  // of eight, those that are there
  EXPECT_FALSE(scene->has_model());
  PickSolver solver(*scene);
  EXPECT_FALSE(solver.Solve(TruePicks(3)).photos.at(ClickedName()).solved());
  EXPECT_TRUE(solver.Solve(TruePicks(5)).photos.at(ClickedName()).solved());
  EXPECT_THAT(solver.Solve(TruePicks(5)).next, HasSubstr("1 more pair to go in this photo"));
  const PickSolution solution = solver.Solve(TruePicks(6));
  const PhotoState& photo = solution.photos.at(ClickedName());
  ASSERT_TRUE(photo.solved());
  EXPECT_THAT(
      photo.cam_from_scan,
      IsNearRigid(ThePickRoom().room().CamFromScan(ThePickRoom().clicked_photo()), 1e-4, 1e-4));
  EXPECT_FALSE(solution.models[0].scan_from_sparse);
  EXPECT_FALSE(photo.found_projection);
  EXPECT_THAT(solution.next, HasSubstr("Enough picks for this photo"));
  const std::string other = ThePickRoom().room().PhotoName(ThePickRoom().other_photo());
  EXPECT_FALSE(solution.photos.at(other).solved());
}

TEST(PickSolution, WithoutASparseModelPicksTellAFocalLengthThatNobodyNames) {
  const auto scene = PhotosAlone({});
  PickSolver solver(*scene);
  const std::vector<SessionPick> picks =
      ThePickRoom().SmoothPicks(ThePickRoom().clicked_photo(), 12);
  const PickSolution few = solver.Solve({picks.begin(), picks.begin() + 7});
  EXPECT_FALSE(few.photos.at(ClickedName()).solved());
  EXPECT_THAT(few.next,
              HasSubstr("1 more pair to go in this photo: nothing says its focal length"));
  const PickSolution solution = solver.Solve(picks);
  const PhotoState& photo = solution.photos.at(ClickedName());
  ASSERT_TRUE(photo.found_projection);
  const double focal = ThePickRoom().room().camera().MeanFocalLength();
  EXPECT_NEAR(photo.found_projection->camera().params[0] / focal, 1, 0.05);
  EXPECT_GT(photo.focal_sigma, 0);
  EXPECT_LT(photo.focal_sigma, 0.05 * focal);
  EXPECT_THAT(solution.next, HasSubstr("Enough picks for this photo"));
}

TEST(PickSolution, BeforeTheRayCasterStandsThePoseIsThereAlready) {
  Progress progress(true);
  const PickScene scene(ThePickRoom().input(), &progress);  // not prepared
  const PickSolution solution = PickSolver(scene).Solve(TruePicks(6));
  EXPECT_FALSE(solution.with_rays);
  EXPECT_TRUE(solution.photos.at(ClickedName()).solved());
  EXPECT_LT(solution.photos.at(ClickedName()).rms_px, 1e-3);
  EXPECT_FALSE(solution.models[0].scan_from_sparse);
}

TEST(PickScene, ThePhotosAreRankedAndWhatIsMissingIsSaid) {
  const PickScene& scene = ThePickRoom().scene();
  ASSERT_EQ(scene.photos().size(), 8u);
  const auto ranked = scene.Ranked({});
  EXPECT_FALSE(ranked[0]->missing);
  EXPECT_FALSE(ranked[1]->missing);
  EXPECT_TRUE(ranked[2]->missing);
  EXPECT_THAT(ranked[2]->problem, HasSubstr("There is no photo"));
  EXPECT_GT(ranked[0]->num_points, 100);
}

}  // namespace
}  // namespace roomtex
