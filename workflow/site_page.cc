#include "workflow/site_page.h"

#include <algorithm>
#include <optional>
#include <set>
#include <vector>

#include <Eigen/Core>

#include "core/command_line.h"
#include "core/text.h"
#include "workflow/html_text.h"
#include "workflow/room_coverage.h"
#include "workflow/site_plan.h"

namespace roomtex {
namespace {

constexpr size_t kPlacesPerRoom = 3;
// Pixels that the largest of the rooms drawn by themselves takes, and that a metre takes at most.
constexpr double kRoomWidth = 300, kRoomHeight = 260, kPixelsPerMetre = 80;

class SitePage {
 public:
  SitePage(const Json& keys, const std::string& to_rooms) : keys_(keys), to_rooms_(to_rooms) {}

  std::string Make() {
    Head();
    Remedies();
    Rooms();
    Joined();
    RoomPlans();
    Places();
    Steps();
    return HtmlPage(keys_["verdict"]["headline"], body_);
  }

 private:
  void Heading(const std::string& text) { body_ += HtmlTag("h2", text) + "\n"; }

  // The sum over the rooms that know it.
  double Sum(const char* key) const {
    double sum = 0;
    for (const Json& room : keys_["rooms"]) {
      if (room.contains(key)) sum += room[key].get<double>();
    }
    return sum;
  }

  void Fact(const std::string& name, const std::string& value) {
    body_ += "<div>" + HtmlTag("dt", name) + HtmlTag("dd", WithUnits(value)) + "</div>";
  }

  void Head() {
    const Json& verdict = keys_["verdict"];
    const std::string state = verdict["state"];
    const Json& counts = keys_["counts"];
    const int num_others = counts["rooms"].get<int>() - counts["trusted"].get<int>();
    const std::string word = state == "trusted" ? VerdictWord(state)
                             : num_others > 0   ? std::to_string(num_others) + " to look after"
                                                : "Doorways to look after";
    body_ += "<header class=\"" + state + "\">" + HtmlTag("p class=\"state\"", word) +
             HtmlTag("h1", verdict["headline"]);
    std::string sentences;
    for (const Json& sentence : verdict["sentences"]) {
      sentences += (sentences.empty() ? "" : " ") + sentence.get<std::string>();
    }
    if (!sentences.empty()) body_ += HtmlTag("p", sentences);
    body_ += "</header>\n<dl class=\"facts\">";
    const double photos = Sum("num_photos"), surface = Sum("surface_m2");
    if (photos > 0) {
      Fact("Photos registered", Number(Sum("num_registered"), 0) + " of " + Number(photos, 0));
    }
    if (surface > 0) {
      Fact("Surface on a photo",
           Percent(1 - Sum("unseen_m2") / surface) + " of " + Number(surface, 0) + " m²");
    }
    const Json* worst = nullptr;
    for (const Json& room : keys_["rooms"]) {
      const bool is_worse = room.contains("expected_error_mm") &&
                            (worst == nullptr || room["expected_error_mm"].get<double>() >
                                                     (*worst)["expected_error_mm"].get<double>());
      if (is_worse) worst = &room;
    }
    if (worst != nullptr) {
      Fact("Largest expected error", Number((*worst)["expected_error_mm"].get<double>(), 1) +
                                         " mm, " + (*worst)["name"].get<std::string>());
    }
    const Json& total = keys_["total"];
    Fact("Processor time", TimeText(total["cpu_seconds"]));
    Fact("Most memory of a step", MemoryText(total["peak_memory_bytes"]));
    body_ += "</dl>\n";
  }

  std::string NameOf(const Json& room) const {
    if (!room["has_report"].get<bool>()) return HtmlTag("b", room["name"]);
    return "<a href=\"" +
           HtmlText(UrlPath(to_rooms_ + room["folder"].get<std::string>() + "/report.html")) +
           "\">" + HtmlText(room["name"]) + "</a>";
  }

  void Remedies() {
    std::string items;
    for (const Json& room : keys_["rooms"]) {
      if (room["state"] == "trusted") continue;
      items += "<li>" + NameOf(room) + ": " + HtmlText(room["headline"]);
      for (const Json& sentence : room["sentences"]) {
        items += "<br><span class=\"quiet\">" + HtmlText(sentence) + "</span>";
      }
      for (const Json& remedy : room["remedies"]) {
        items += "<div class=\"small\">" + HtmlRemedy(remedy) + "</div>";
      }
      items += "</li>";
    }
    if (items.empty()) return;
    body_ += "<section class=\"todo\"><h2>What to do now</h2><ul>" + items + "</ul></section>\n";
  }

  static std::string RegisteredCell(const Json& room) {
    const bool is_known = room.contains("num_photos");
    return HtmlTag("td class=\"n\"", is_known
                                         ? Number(room["num_registered"].get<double>(), 0) +
                                               " of " + Number(room["num_photos"].get<double>(), 0)
                                         : "\u2013");
  }

  void Rooms() {
    Heading("Rooms");
    body_ +=
        "<p class=\"quiet\">The name leads to the room's own report. Error: expected, one standard "
        "deviation, at the photos and at the far corner. Surface: share that is on a photo, of the "
        "surface that was scanned.</p><div class=\"table\"><table><thead><tr>"
        "<th>Room</th><th>Verdict</th><th class=\"n\">Photos</th><th class=\"n\">Surface, %</th>"
        "<th class=\"n\">of m²</th><th class=\"n\">Error, mm</th><th class=\"n\">Corner, mm</th>"
        "<th class=\"n\">Time</th><th class=\"n\">Processor</th><th class=\"n\">Memory</th>"
        "<th>Notes</th></tr></thead><tbody>";
    for (const Json& room : keys_["rooms"]) {
      const std::string state = room["state"];
      body_ += "<tr><td>" + NameOf(room) + "</td>" +
               HtmlTag("td class=\"state " + state + "\"", VerdictWord(state)) +
               RegisteredCell(room) + HtmlCell(room, "coverage", 100, 0) +
               HtmlCell(room, "surface_m2", 1, 0) + HtmlCell(room, "expected_error_mm", 1, 1) +
               HtmlCell(room, "far_corner_mm", 1, 1) +
               HtmlTag("td class=\"n\"", TimeText(room["seconds"])) +
               HtmlTag("td class=\"n\"", TimeText(room["cpu_seconds"])) +
               HtmlTag("td class=\"n\"", MemoryText(room["peak_memory_bytes"])) +
               HtmlTag("td class=\"notes\"", room["notes"]) + "</tr>";
    }
    body_ += "</tbody></table></div>\n";
  }

  // How the rooms stand to each other, if roomtex-join ran; nothing of a report that it did not
  // write.
  void Joined() {
    if (keys_["joined"].is_null()) return;
    const std::string before = body_;
    try {
      Plans();
      Links();
      Loops();
    } catch (const Json::exception&) {
      body_ = before;
      drawn_.clear();
    }
  }

  void Plans() {
    const Json& joined = keys_["joined"];
    std::vector<std::string> frames = {joined["reference"]};
    std::string alone;
    for (const Json& room : joined["rooms"]) {
      const std::string frame = room.at("frame"), name = room.at("name");
      const auto others =
          std::count_if(joined["rooms"].begin(), joined["rooms"].end(),
                        [&](const Json& other) { return other.at("frame") == frame; });
      if (others == 1 && joined["rooms"].size() > 1) {
        alone += (alone.empty() ? "" : ", ") + name;
      } else if (std::find(frames.begin(), frames.end(), frame) == frames.end()) {
        frames.push_back(frame);
      }
    }
    Heading("How the rooms stand to each other");
    for (const std::string& frame : frames) {
      const std::string plan = DrawSitePlan(keys_, frame, to_rooms_);
      if (plan.empty()) continue;
      for (const Json& room : joined["rooms"]) {
        if (room.at("frame") == frame) drawn_.insert(room.at("name").get<std::string>());
      }
      body_ += "<figure>" + plan + "<figcaption>In the scan frame of " + HtmlText(frame) +
               ". Circles: doorways with photos or scans that both rooms share; red: not to be "
               "trusted. Colours as in the reports of the rooms: blue two photos or more, orange "
               "one, red none.</figcaption></figure>\n";
    }
    if (!alone.empty()) {
      body_ += HtmlTag("p",
                       "Nothing links these rooms to others, and each stands in its own "
                       "frame: " +
                           alone +
                           ". Let two or three photos of each doorway be in the folders of both "
                           "rooms.") +
               "\n";
    }
    if (joined["scene"].is_string()) {
      const std::string scene = joined["scene"];
      body_ += "<p>The rooms that stand in one frame, as one scene: <a href=\"" +
               HtmlText(UrlPath(to_rooms_ + "joined/" + scene)) + "\">" + HtmlText(scene) +
               "</a> (it refers to the rooms' own files).</p>\n";
    }
  }

  // Scans of one file link all rooms of it to each other: those that are as they should be are only
  // counted.
  void Links() {
    int num_silent = 0;
    std::string rows;
    for (const Json& link : keys_["joined"]["links"]) {
      const bool trusted = link.at("trusted");
      if (trusted && link.at("num_photos") == 0) {
        ++num_silent;
        continue;
      }
      rows += "<tr>" +
              HtmlTag("td", link.at("first").get<std::string>() + " – " +
                                link.at("second").get<std::string>()) +
              HtmlTag(trusted ? "td class=\"state trusted\"" : "td class=\"state untrusted\"",
                      VerdictWord(trusted ? "trusted" : "untrusted")) +
              HtmlTag("td class=\"n\"", Number(link.at("num_photos").get<double>(), 0)) +
              HtmlTag("td class=\"n\"", Number(link.at("num_scans").get<double>(), 0)) +
              HtmlTag("td class=\"n\"", Number(link.at("num_agreeing").get<double>(), 0));
      const Json& residual = link.at("residual");
      for (const char* key : {"offset_mm", "offset_sigma_mm"}) {
        rows += HtmlCell(residual, key, 1, 1);
      }
      for (const char* key : {"turn_deg", "turn_sigma_deg"}) rows += HtmlCell(residual, key, 1, 2);
      rows += HtmlTag("td class=\"notes\"", link.at("reason")) + "</tr>";
    }
    if (!rows.empty()) {
      body_ +=
          "<p class=\"quiet\">Misfit: of a doorway, against the places of its two rooms by all "
          "others together; a dash where only it holds them. Expected: one standard deviation."
          "</p><div class=\"table\"><table><thead><tr><th>Doorway</th><th>Verdict</th>"
          "<th class=\"n\">Photos</th><th class=\"n\">Scans</th><th class=\"n\">Agree</th>"
          "<th class=\"n\">Misfit, mm</th><th class=\"n\">expected</th>"
          "<th class=\"n\">Misfit, °</th><th class=\"n\">expected</th><th>Why</th>"
          "</tr></thead><tbody>" +
          rows + "</tbody></table></div>\n";
    }
    if (num_silent > 0) {
      body_ += HtmlTag("p class=\"quiet\"", std::to_string(num_silent) +
                                                " pairs of rooms share scans and nothing else; "
                                                "all of them fit.") +
               "\n";
    }
  }

  void Loops() {
    const Json& loops = keys_["joined"]["loops"];
    if (loops.empty()) return;
    double worst = 0;
    int num_open = 0;
    for (const Json& loop : loops) {
      worst = std::max(worst, loop.at("offset_mm").get<double>());
      num_open += !loop.at("closes").get<bool>();
    }
    body_ +=
        HtmlTag("p", std::to_string(loops.size()) + (loops.size() == 1 ? " way" : " ways") +
                         " around over several doorways: " +
                         (num_open == 0 ? "closed" : std::to_string(num_open) + " not closed") +
                         ", at worst to " + Number(worst, 1) + " mm.") +
        "\n";
  }

  // The rooms that are in no plan with others, beside each other to one scale.
  void RoomPlans() {
    std::vector<const Json*> rooms;
    double units = kPixelsPerMetre;
    for (const Json& room : keys_["rooms"]) {
      const std::optional<Eigen::Vector2d> size = PlanSize(room);
      if (!size || drawn_.count(room["name"].get<std::string>()) > 0) continue;
      units = std::min({units, kRoomWidth / size->x(), kRoomHeight / size->y()});
      rooms.push_back(&room);
    }
    if (rooms.empty()) return;
    Heading(rooms.size() > 1 ? "Rooms in frames of their own" : "A room in a frame of its own");
    body_ +=
        HtmlTag(
            "p class=\"quiet\"",
            std::string(rooms.size() > 1
                            ? "These rooms stand in no common frame. They are drawn side by side, "
                              "to one scale; where they stand to each other is not known. "
                            : "") +
                "Colours as in the reports of the rooms: blue two photos or more, orange "
                "one, red none.") +
        "\n<div class=\"plans\">";
    for (const Json* room : rooms) {
      const Eigen::Vector2d size = *PlanSize(*room);
      const std::string state = (*room)["state"];
      body_ += "<figure>" + DrawRoomPlan(*room, units, to_rooms_) + "<figcaption>" + NameOf(*room) +
               ", " + Number(size.x(), 1) + " × " + Number(size.y(), 1) + "\u00a0m" +
               (state == "trusted" ? "" : ". " + HtmlText(VerdictWord(state))) +
               "</figcaption></figure>";
    }
    body_ += "</div>\n";
  }

  // The rooms of which most is missing first.
  void Places() {
    std::vector<const Json*> rooms;
    for (const Json& room : keys_["rooms"]) {
      if (!room["places_to_photograph"].empty()) rooms.push_back(&room);
    }
    if (rooms.empty()) return;
    std::stable_sort(rooms.begin(), rooms.end(), [](const Json* a, const Json* b) {
      return (*a)["unseen_m2"].get<double>() > (*b)["unseen_m2"].get<double>();
    });
    Heading("What to photograph again");
    body_ +=
        "<p class=\"quiet\">The rooms of which most is on no photo first. Where the arrows point "
        "is "
        "in the plan of the room's report.</p>\n";
    for (const Json* room : rooms) {
      body_ += "<h3>" + NameOf(*room) + ": " + Number((*room)["unseen_m2"].get<double>(), 1) +
               " m² on no photo</h3><ul>";
      const Json& places = (*room)["places_to_photograph"];
      for (size_t i = 0; i < std::min(places.size(), kPlacesPerRoom); ++i) {
        body_ += "<li><b>" + std::string(1, static_cast<char>('A' + i)) +
                 "</b>: " + HtmlText(PlaceText(PlaceFromJson(places[i]))) + "</li>";
      }
      body_ += "</ul>\n";
    }
  }

  void Steps() {
    if (keys_["steps"].empty()) return;
    Heading("What it cost");
    body_ +=
        "<p class=\"quiet\">Sums over all rooms, of the last run of each step; memory: of the room "
        "that needs most.</p><div class=\"table\"><table><thead><tr><th>Step</th>"
        "<th class=\"n\">Time</th><th class=\"n\">Processor</th><th class=\"n\">Memory</th>"
        "<th>of</th></tr></thead><tbody>";
    for (const Json& step : keys_["steps"]) {
      body_ += "<tr>" + HtmlTag("td", step["name"]) +
               HtmlTag("td class=\"n\"", TimeText(step["seconds"])) +
               HtmlTag("td class=\"n\"", TimeText(step["cpu_seconds"])) +
               HtmlTag("td class=\"n\"", MemoryText(step["peak_memory_bytes"])) +
               HtmlTag("td", step["largest_room"]) + "</tr>";
    }
    const Json& total = keys_["total"];
    body_ += "<tr class=\"sum\"><td>All</td>" +
             HtmlTag("td class=\"n\"", TimeText(total["seconds"])) +
             HtmlTag("td class=\"n\"", TimeText(total["cpu_seconds"])) +
             HtmlTag("td class=\"n\"", MemoryText(total["peak_memory_bytes"])) +
             "<td></td></tr></tbody></table></div>\n" +
             HtmlTag("p class=\"quiet small\"", std::string("roomtex ") + Version()) + "\n";
  }

  const Json& keys_;
  std::string to_rooms_, body_;
  std::set<std::string> drawn_;  // rooms in a plan with others
};

}  // namespace

std::string MakeSitePage(const Json& keys, const std::string& to_rooms) {
  return SitePage(keys, to_rooms).Make();
}

}  // namespace roomtex
