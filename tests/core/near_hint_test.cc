#include "core/near_hint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

TEST(NearHint, IsReadWithCommasInTheName) {
  const NearHint hint = ParseNearHint("a, b.jpg,1.5,-2,0.25");
  EXPECT_EQ(hint.image_name, "a, b.jpg");
  EXPECT_EQ(hint.x_in_scan, Eigen::Vector3d(1.5, -2, 0.25));
  EXPECT_EQ(ParseNearHint("a.jpg, 1, +2, -3").x_in_scan, Eigen::Vector3d(1, 2, -3));
  for (const char* text : {"", "a.jpg", "a.jpg,1,2", "a.jpg,1,2,x", ",1,2,3", "a.jpg,1,2,nan",
                           "a.jpg,0x10,2,3", "a.jpg,1,2,", "a.jpg,1,2 3,4"}) {
    try {
      ParseNearHint(text);
      ADD_FAILURE() << text;
    } catch (const UsageError& error) {
      EXPECT_THAT(error.what(), HasSubstr("expected PHOTO,X,Y,Z"));
    }
  }
}

}  // namespace
}  // namespace roomtex
