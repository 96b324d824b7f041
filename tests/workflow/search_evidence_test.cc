// How the place was found, as roomtex-auto's report says it.

#include "workflow/search_evidence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace roomtex {
namespace {

using testing::HasSubstr;
using testing::Not;

Json Start(double score, double x, const Json& photos = nullptr) {
  return {{"rays", {{"score", score}, {"agreeing_share", score}}},
          {"photos_middle", {x, 0.5, -1}},
          {"num_on_surface", 400},
          {"surface_rms_m", 0.0065},
          {"photos", photos},
          {"looks_alike", false}};
}

// Ranked by score; the photos chose the second one.
Json Search() {
  const Json weak = Start(0.3, 7), strong = Start(0.9, 5),
             right = Start(0.85, 3, {{"share", 0.62}, {"chance", 0.05}, {"num_patches", 321}});
  return {{"method", "geometry"},   {"verdict", "trusted"},
          {"num_hypotheses", 60},   {"best", right},
          {"second", strong},       {"ratio", 0.94},
          {"mirrored_score", 0.4},  {"chance_wrong", 0.055},
          {"chance_counted", true}, {"hypotheses", {strong, right, weak}}};
}

std::vector<std::string> PlaceNames(const Json& search) {
  std::vector<std::string> names;
  for (const Json& place : search["places"]) names.push_back(place["place"]);
  return names;
}

TEST(SearchEvidence, ListsTheBestPlaceThenItsRivalsThenTheRest) {
  const Json search = SearchEvidence({{"search", Search()}})[0];
  EXPECT_THAT(PlaceNames(search), testing::ElementsAre("best", "second", "mirror image", "other"));
  const Json& places = search["places"];
  EXPECT_EQ(places[0]["score"], 0.85);
  EXPECT_EQ(places[0]["surface_rms_mm"], 6.5);
  EXPECT_EQ(places[0]["corners_in_place"], 0.62);
  EXPECT_EQ(places[0]["num_corners"], 321);
  EXPECT_EQ(places[1]["photos_middle"][0], 5.0);
  EXPECT_TRUE(places[1]["corners_in_place"].is_null());
  EXPECT_EQ(places[2]["score"], 0.4);
  EXPECT_EQ(places[2]["mirrored"], true);
  EXPECT_EQ(places[3]["mirrored"], false);
  const std::string html = SearchHtml(Json::array({search}));
  EXPECT_LT(html.find("3.00, 0.50, -1.00"), html.find("5.00, 0.50, -1.00"));
  EXPECT_THAT(html, HasSubstr("0.94 times the score"));
}

TEST(SearchEvidence, SaysWhatTheChanceMeansAndWhereItIsAGuess) {
  const auto sentences = [](const Json& search) {
    return SearchEvidence({{"search", search}})[0]["sentences"].dump();
  };
  EXPECT_THAT(sentences(Search()), AllOf(HasSubstr("Of 1000 answers like this at most 55 would be"),
                                         Not(HasSubstr("guess"))));
  Json guessed = Search();
  guessed["verdict"] = "unconfirmed";
  guessed["chance_wrong"] = 0.5;
  guessed["chance_counted"] = false;
  EXPECT_THAT(sentences(guessed), AllOf(HasSubstr("about 500 would be"), HasSubstr("a guess")));
  EXPECT_THAT(sentences(guessed), HasSubstr("hardly anything besides geometry"));
}

TEST(SearchEvidence, HasOnePartForEveryModelThatWasSearchedFor) {
  EXPECT_TRUE(SearchEvidence(nullptr).empty());
  EXPECT_TRUE(SearchEvidence({{"search", nullptr}}).empty());  // six picks
  const Json models = {{{"input_path", "sparse/0"}, {"search", nullptr}},
                       {{"input_path", "sparse/1"}, {"search", Search()}}};
  const Json searches = SearchEvidence({{"search", nullptr}, {"models", models}});
  ASSERT_EQ(searches.size(), 1u);
  EXPECT_EQ(searches[0]["model"], "sparse/1");
  EXPECT_THAT(SearchHtml(searches), HasSubstr("<h3>sparse/1</h3>"));
}

TEST(SearchEvidence, WithoutHypothesesSaysTheMethodAlone) {
  const Json known = SearchEvidence({{"search", {{"method", "known_poses"}}}})[0];
  EXPECT_TRUE(known["places"].empty());
  EXPECT_THAT(SearchHtml(Json::array({known})),
              AllOf(HasSubstr("not searched for"), Not(HasSubstr("<table"))));
  const Json alone = SearchEvidence(
      {{"search",
        {{"method", "appearance of each photo"},
         {"num_hypotheses", 9},
         {"best", nullptr},
         {"second", nullptr},
         {"chance_wrong", 0.02},
         {"chance_counted", true},
         {"photos", {{{"name", "a"}, {"placed", true}}, {{"name", "b"}, {"placed", false}}}}}}})[0];
  EXPECT_THAT(SearchHtml(Json::array({alone})), HasSubstr("what it shows of the scan: 1 of 2."));
  EXPECT_THAT(SearchHtml(Json::array({alone})), HasSubstr("at most 20"));
}

}  // namespace
}  // namespace roomtex
