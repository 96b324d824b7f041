#include "align/clicks/picks.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

SparseModel ModelWith(const std::vector<std::string>& names) {
  SparseModel model;
  model.cameras[1] = {1, CameraModel::kPinhole, 640, 480, {500, 500, 320, 240}};
  for (const std::string& name : names) {
    SparseImage image;
    image.image_id = static_cast<uint32_t>(model.images.size()) + 1;
    image.camera_id = 1;
    image.name = name;
    model.images[image.image_id] = image;
  }
  return model;
}

std::vector<Pick> PicksOf(const std::string& name, int count) {
  std::vector<Pick> picks;
  for (int i = 0; i < count; ++i) {
    picks.push_back({name, {10.0 * i, 20.0 + i}, {1.0 * i, 2.0, 3.0}, i + 2});
  }
  return picks;
}

TEST(Picks, ThoseSwitchedOffDoNotCount) {
  std::vector<Pick> picks = PicksOf("a.jpg", 6);
  picks[4].weight = 0;
  EXPECT_INPUT_ERROR(CheckPicksAgainstModel("picks.csv", picks, ModelWith({"a.jpg"})),
                     "6 picks, of which 5 count");
}

TEST(Picks, NamesTheNearestPhotoForOneThatIsNotInTheModel) {
  const SparseModel model = ModelWith({"left/a1.jpg", "left/a2.jpg", "right/b.jpg"});
  EXPECT_INPUT_ERROR(CheckPicksAgainstModel("p.csv", PicksOf("right/B.JPG", 6), model),
                     "nearest name: right/b.jpg");
}

TEST(Picks, TakeTheNameOfTheOnlyPhotoThatHasItInAFolder) {
  const SparseModel model = ModelWith(
      {"scanner/a.jpg", "mine/b.jpg", "scanner/b.jpg", "c.jpg", "mine/c.jpg", "mine/not-d.jpg"});
  std::vector<Pick> picks;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg", "d.jpg", "mine/b.jpg", "nowhere/a.jpg"}) {
    picks.push_back(PicksOf(name, 1)[0]);
  }
  NamePicksAsInModels({&model}, &picks);
  std::vector<std::string> names;
  for (const Pick& pick : picks) names.push_back(pick.image_name);
  EXPECT_EQ(names, (std::vector<std::string>{"scanner/a.jpg", "b.jpg", "c.jpg", "d.jpg",
                                             "mine/b.jpg", "nowhere/a.jpg"}));
}

TEST(Picks, OfSeveralModelsBelongToTheOneThatHoldsTheirPhoto) {
  const SparseModel left = ModelWith({"left/a.jpg", "left/b.jpg", "c.jpg"});
  const SparseModel right = ModelWith({"right/a.jpg", "right/d.jpg", "other/c.jpg"});
  std::vector<Pick> picks;
  for (const char* name : {"d.jpg", "b.jpg", "c.jpg"}) picks.push_back(PicksOf(name, 1)[0]);
  NamePicksAsInModels({&left, &right}, &picks);
  EXPECT_EQ(picks[0].image_name, "right/d.jpg");
  EXPECT_EQ(picks[1].image_name, "left/b.jpg");
  EXPECT_EQ(picks[2].image_name, "c.jpg");
  EXPECT_NO_THROW(CheckPickNames("p.csv", picks, {&left, &right}));
  std::vector<Pick> either = PicksOf("a.jpg", 1);
  NamePicksAsInModels({&left, &right}, &either);
  EXPECT_INPUT_ERROR(CheckPickNames("p.csv", either, {&left, &right}), "the photo a.jpg is not in");
}

TEST(Picks, RefusesPixelOutsideThePhoto) {
  std::vector<Pick> picks = PicksOf("a.jpg", 6);
  picks[3].x_in_img.x() = 640.5;
  EXPECT_INPUT_ERROR(CheckPicksAgainstModel("p.csv", picks, ModelWith({"a.jpg"})), "line 5");
  picks[3].x_in_img.x() = 640;
  EXPECT_NO_THROW(CheckPicksAgainstModel("p.csv", picks, ModelWith({"a.jpg"})));
}

TEST(Picks, SixSpreadOverPhotosAreEnoughAndFiveAreNot) {
  std::vector<Pick> picks = PicksOf("a.jpg", 3);
  for (const Pick& pick : PicksOf("b.jpg", 2)) picks.push_back(pick);
  const SparseModel model = ModelWith({"a.jpg", "b.jpg"});
  EXPECT_INPUT_ERROR(CheckPicksAgainstModel("p.csv", picks, model), "holds 5 picks; at least 6");
  picks.push_back({"b.jpg", {1, 1}, {9, 9, 9}, 12});
  EXPECT_NO_THROW(CheckPicksAgainstModel("p.csv", picks, model));
}

}  // namespace
}  // namespace roomtex
