#include "core/text.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include <gtest/gtest.h>

#include "core/random_stream.h"

namespace roomtex {
namespace {

std::string Printed(const char* format, int digits, double value) {
  char text[400];
  std::snprintf(text, sizeof text, format, digits, value);
  return text;
}

TEST(Text, PrintsNumbersAsCDoes) {
  RandomStream random(3);
  std::vector<double> values = {0,     -0.0, 0.5, 1.5,  2.5,     1e-320, 1e300, -1234567.875,
                                0.125, 1e5,  1e6, 1e17, 999999.5};
  values.push_back(std::numeric_limits<double>::infinity());
  values.push_back(-std::numeric_limits<double>::infinity());
  values.push_back(std::numeric_limits<double>::quiet_NaN());
  for (int i = 0; i < 2000; ++i) {
    values.push_back(random.Gaussian() * std::pow(10, random.Uniform(-12, 12)));
  }
  for (const double value : values) {
    for (const int digits : {0, 1, 2, 3, 4, 7, 12}) {
      ASSERT_EQ(Number(value, digits), Printed("%.*f", digits, value));
    }
    for (const int digits : {2, 4, 6, 10, 12, 17}) {
      ASSERT_EQ(Significant(value, digits), Printed("%.*g", digits, value));
    }
  }
}

TEST(Text, ExactNumbersReadBackToTheLastBit) {
  RandomStream random(4);
  for (int i = 0; i < 2000; ++i) {
    const double value = random.Gaussian() * std::pow(10, random.Uniform(-300, 300));
    const std::optional<double> again = ParseNumber(Exact(value));
    ASSERT_TRUE(again);
    ASSERT_EQ(*again, value);
  }
}

TEST(Text, SharesArePerCents) {
  EXPECT_EQ(Percent(0.254), "25 %");
  EXPECT_EQ(Percent(1), "100 %");
  EXPECT_EQ(Millimetres(9.64), "9.6 mm");
  EXPECT_EQ(Millimetres(131.4), "131 mm");
  EXPECT_EQ(Millimetres(1250), "1.25 m");
  EXPECT_EQ(Millimetres(std::numeric_limits<double>::quiet_NaN()), "unknown");
}

TEST(Text, ParsesFiniteNumbersOnly) {
  EXPECT_EQ(ParseNumber("-1.5e3"), -1500);
  EXPECT_EQ(ParseNumber("+2"), 2);
  EXPECT_EQ(ParseNumber(".5"), 0.5);
  for (const char* bad :
       {"", "+", "nan", "inf", "1e999", "0x10", " 1", "1 ", "1,5", "1.5px", "++1"}) {
    EXPECT_FALSE(ParseNumber(bad)) << bad;
  }
}

TEST(Text, QuotesWhatMayStandInAMessage) {
  EXPECT_EQ(Quoted("a.jpg"), "\"a.jpg\"");
  EXPECT_EQ(Quoted("a\tb\x7f"), "\"a?b?\"");
  EXPECT_EQ(Quoted(std::string(50, 'x')), "\"" + std::string(40, 'x') + "...\"");
  EXPECT_EQ(Quoted("K\xc3\xbc"
                   "che"),
            "\"K\xc3\xbc"
            "che\"");
  EXPECT_EQ(Quoted("\xff"
                   "a\xc3"),
            "\"?a?\"");
  EXPECT_EQ(Quoted(std::string(39, 'x') + "\xc3\xbc"), "\"" + std::string(39, 'x') + "...\"");
}

TEST(Text, NamesTheNearestOfSome) {
  EXPECT_EQ(NearestName({"photo_001.jpg", "photo_010.jpg", "wall.png"}, "PHOTO_0l0.jpg"),
            "photo_010.jpg");
  EXPECT_EQ(NearestName({}, "photo"), "");
  EXPECT_EQ(EditDistance("kitten", "sitting"), 3u);
}

TEST(Text, TrimsBothEnds) {
  EXPECT_EQ(Trimmed(" \ta b\r\n"), "a b");
  EXPECT_EQ(Trimmed(" \t"), "");
}

TEST(Base64, OfTheVectorsOfItsRfc) {
  const auto encode = [](const std::string& text) { return Base64(text.data(), text.size()); };
  EXPECT_EQ(encode(""), "");
  EXPECT_EQ(encode("f"), "Zg==");
  EXPECT_EQ(encode("fo"), "Zm8=");
  EXPECT_EQ(encode("foo"), "Zm9v");
  EXPECT_EQ(encode("foob"), "Zm9vYg==");
  EXPECT_EQ(encode("fooba"), "Zm9vYmE=");
  EXPECT_EQ(encode("foobar"), "Zm9vYmFy");
  EXPECT_EQ(encode("\xff\xfe\xfd"), "//79");
}

TEST(LowerCase, ChangesTheLettersOfAsciiOnly) {
  EXPECT_EQ(LowerCase("Photo_01.JPG"), "photo_01.jpg");
  EXPECT_EQ(LowerCase("K\xc3\x9cR @[`{"), "k\xc3\x9cr @[`{");
}

TEST(BeginsWith, WantsAllOfTheStart) {
  EXPECT_TRUE(BeginsWith("--help", "--"));
  EXPECT_TRUE(BeginsWith("", ""));
  EXPECT_FALSE(BeginsWith("-", "--"));
  EXPECT_FALSE(BeginsWith("a--", "--"));
}

}  // namespace
}  // namespace roomtex
