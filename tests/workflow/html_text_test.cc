#include "workflow/html_text.h"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

TEST(HtmlText, IsOnlyText) {
  EXPECT_EQ(HtmlText("<b a=\"1\">R&D's</b>"), "&lt;b a=&quot;1&quot;&gt;R&amp;D&#39;s&lt;/b&gt;");
  EXPECT_EQ(HtmlText("Küche 1.jpg"), "Küche 1.jpg");
}

// RFC 4648, section 10.
TEST(HtmlPicture, IsNoWiderThanAskedForAndInThePageItself) {
  const TempFolder folder;
  cv::imwrite(folder / "a.png", cv::Mat3b(40, 100, cv::Vec3b(1, 2, 3)));
  const std::string tag = HtmlPicture(folder / "a.png", 50, "a \"view\"");
  EXPECT_NE(tag.find("width=\"50\" height=\"20\" src=\"data:image/jpeg;base64,"),
            std::string::npos);
  EXPECT_NE(tag.find("alt=\"a &quot;view&quot;\""), std::string::npos);
  EXPECT_EQ(HtmlPicture(folder / "none.png", 50, ""), "");
}

}  // namespace
}  // namespace roomtex
