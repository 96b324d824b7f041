#include "workflow/search_evidence.h"

#include <array>
#include <cmath>
#include <utility>

#include "core/text.h"
#include "workflow/html_text.h"

namespace roomtex {
namespace {

constexpr size_t kMostRows = 6;  // of the page's table; report.json has all

// Of the verdict of the search; that of the photos follows.
std::string VerdictSentence(const std::string& verdict) {
  static constexpr std::array<std::pair<const char*, const char*>, 8> kSentences = {{
      {"trusted", "The search found one place, and what it did not use speaks for it."},
      {"unconfirmed", "The best place fits, but hardly anything besides geometry speaks for it."},
      {"ambiguous", "The best place fits little better than another one or the mirror image."},
      {"mirrored", "The mirror image of the photos' model fits the scan better than the model."},
      {"open", "The surface does not hold the photos' model in every direction."},
      {"weak", "Even the best place fits badly."},
      {"none", "No place was found where the photos' model fits the scan."},
      {"photos contradict", "The photos do not show at the best place what the scan shows there."},
  }};
  for (const auto& [name, sentence] : kSentences) {
    if (verdict == name) return sentence;
  }
  return "";
}

std::string MethodSentence(const Json& search) {
  const std::string method = search.value("method", "");
  if (method == "known_poses") {
    return "It was not searched for: photos of the scanner's own stand where the scan's file has "
           "them.";
  }
  if (method == "appearance of each photo") {
    size_t num_placed = 0;
    const Json photos = search.value("photos", Json::array());
    for (const Json& photo : photos) num_placed += photo.value("placed", false);
    return "Each photo was placed by itself, by what it shows of the scan: " +
           std::to_string(num_placed) + " of " + std::to_string(photos.size()) + ".";
  }
  std::string sentence = "Searched for by geometry: of " +
                         Number(NumberAt(search, {"num_hypotheses"}), 0) +
                         " starts these fit the scan's surface best.";
  if (method == "geometry and appearance") {
    sentence += " Photos and scan look alike at the best place, and no other counts then.";
  }
  return sentence;
}

// best against the rest.
std::string RatioSentence(const Json& search) {
  if (!search.value("best", Json()).is_object()) return "";
  return "The best place has " + Number(NumberAt(search, {"ratio"}), 2) +
         " times the score of the next best one or of the mirror image, whichever is more.";
}

std::string FeaturesSentence(const Json& search) {
  std::string sentence;
  const Json appearance = search.value("appearance", Json());
  if (appearance.is_object()) {
    sentence = "Features that photos and scan have in common: " +
               Number(NumberAt(appearance, {"num_cells"}), 0) +
               " places of the scan agree on where the photos are, " +
               Number(NumberAt(appearance, {"num_cells_second"}), 0) + " on the next best answer.";
  }
  const Json placed = search.value("placed_photos", Json());
  if (placed.is_object()) {
    sentence += std::string(sentence.empty() ? "" : " ") + "Of " +
                Number(NumberAt(placed, {"num_asked"}), 0) + " photos that were placed alone, " +
                Number(NumberAt(placed, {"num_placed"}), 0) + " have a place, and " +
                Number(NumberAt(placed, {"num_agreeing"}), 0) + " agree with each other.";
  }
  return sentence;
}

// What chance_wrong means.
std::string ChanceSentence(const Json& search) {
  const double chance = NumberAt(search, {"chance_wrong"});
  if (!std::isfinite(chance)) return "";
  const std::string of_1000 = Number(1000 * chance, 0);
  if (search.value("chance_counted", false)) {
    return "Of 1000 answers like this at most " + of_1000 +
           " would be wrong (95 % sure, by counting in rooms where the answer is known).";
  }
  return "Of 1000 answers like this about " + of_1000 +
         " would be wrong; that is a guess, nobody has counted such answers.";
}

// A row of the table. place: "best", "second", "other", "mirror image".
Json PlaceToJson(const std::string& place, const Json& start) {
  const auto of = [&start](const char* group, const char* key) {
    const Json json = start.value(group, Json());
    return json.is_object() ? json.value(key, Json()) : Json();
  };
  return {{"place", place},
          {"mirrored", place == "mirror image"},
          {"photos_middle", start.value("photos_middle", Json())},
          {"score", of("rays", "score")},
          {"rays_agreeing", of("rays", "agreeing_share")},
          {"points_on_surface", start.value("num_on_surface", Json())},
          {"surface_rms_mm", NumberOrNull(1000 * NumberAt(start, {"surface_rms_m"}))},
          {"corners_in_place", of("photos", "share")},
          {"corners_by_chance", of("photos", "chance")},
          {"num_corners", of("photos", "num_patches")},
          {"looks_alike", start.value("looks_alike", Json())}};
}

Json PlacesOf(const Json& search) {
  const Json starts = search.value("hypotheses", Json::array());
  Json named = Json::array(), others = Json::array();
  for (const char* key : {"best", "second"}) {
    const Json start = search.value(key, Json());
    if (start.is_object()) named.push_back(PlaceToJson(key, start));
  }
  for (const Json& start : starts) {
    if (start == search["best"] || start == search["second"]) continue;
    others.push_back(PlaceToJson("other", start));
  }
  if (NumberAt(search, {"mirrored_score"}) > 0) {
    named.push_back(PlaceToJson("mirror image", {{"rays", {{"score", search["mirrored_score"]}}}}));
  }
  named.insert(named.end(), others.begin(), others.end());
  return named;
}

std::string PlaceText(const Json& place) {
  const Json& middle = place["photos_middle"];
  if (!middle.is_array()) return "nowhere";
  std::string text;
  for (const Json& x : middle) text += (text.empty() ? "" : ", ") + Number(x.get<double>(), 2);
  return text;
}

std::string AlikeText(const Json& place) {
  const Json& alike = place["looks_alike"];
  return !alike.is_boolean() ? "–" : alike.get<bool>() ? "yes" : "no";
}

std::string TableHtml(const Json& places) {
  std::string html =
      "<p class=\"quiet\">Photos about: the middle of their places, scan frame. Score: the share "
      "of the photos' rays that end on the scan's surface where their points are; those that leave "
      "the scan count half. Corners: of the scan's intensity; in place are those that the photos "
      "show where the scan has them. The mirror image of the photos' model is nowhere, so that it "
      "says how well a wrong place fits.</p>"
      "<div class=\"table\"><table><thead><tr><th>Place</th>"
      "<th class=\"n\">Photos about, m</th>"
      "<th class=\"n\">Score</th><th class=\"n\">Rays that<br>agree, %</th>"
      "<th class=\"n\">Points on<br>the surface</th><th class=\"n\">Off it,<br>mm</th>"
      "<th class=\"n\">Corners</th><th class=\"n\">in place,<br>%</th>"
      "<th class=\"n\">by chance,<br>%</th><th class=\"n\">Looks<br>alike</th></tr></thead><tbody>";
  for (size_t i = 0; i < places.size() && i < kMostRows; ++i) {
    const Json& place = places[i];
    const std::string name = place["place"];
    html += (name == "best" ? "<tr class=\"best\">" : "<tr>") +
            HtmlTag("td class=\"state\"", name == "other" ? "" : name) +
            HtmlTag("td class=\"n\"", PlaceText(place)) + HtmlCell(place, "score", 1, 2) +
            HtmlCell(place, "rays_agreeing", 100, 0) + HtmlCell(place, "points_on_surface", 1, 0) +
            HtmlCell(place, "surface_rms_mm", 1, 1) + HtmlCell(place, "num_corners", 1, 0) +
            HtmlCell(place, "corners_in_place", 100, 0) +
            HtmlCell(place, "corners_by_chance", 100, 0) +
            HtmlTag("td class=\"n\"", AlikeText(place)) + "</tr>";
  }
  html += "</tbody></table></div>\n";
  if (places.size() > kMostRows) {
    html += "<p class=\"quiet small\">" + std::to_string(places.size() - kMostRows) +
            " more in report.json.</p>\n";
  }
  return html;
}

}  // namespace

Json SearchEvidence(const Json& align) {
  Json searches = Json::array();
  const auto add = [&searches](const Json& report, const Json& model) {
    const Json search = report.value("search", Json());
    if (!search.is_object()) return;
    Json sentences = Json::array();
    for (const std::string& sentence :
         {VerdictSentence(search.value("verdict", "")), MethodSentence(search),
          RatioSentence(search), FeaturesSentence(search), ChanceSentence(search)}) {
      if (!sentence.empty()) sentences.push_back(sentence);
    }
    Json one = {{"model", model}, {"sentences", sentences}, {"places", PlacesOf(search)}};
    for (const char* key :
         {"method", "verdict", "num_hypotheses", "ratio", "chance_wrong", "chance_counted"}) {
      one[key] = search.value(key, Json());
    }
    searches.push_back(one);
  };
  if (!align.is_object()) return searches;
  const Json models = align.value("models", Json());
  if (!models.is_array()) {
    add(align, nullptr);
    return searches;
  }
  for (const Json& model : models) add(model, model.value("input_path", Json()));
  return searches;
}

std::string SearchHtml(const Json& searches) {
  std::string html;
  for (const Json& search : searches) {
    if (search["model"].is_string()) html += HtmlTag("h3", search["model"]);
    for (const Json& sentence : search["sentences"]) html += HtmlTag("p", WithUnits(sentence));
    if (!search["places"].empty()) html += TableHtml(search["places"]);
  }
  return html;
}

}  // namespace roomtex
