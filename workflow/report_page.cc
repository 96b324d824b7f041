#include "workflow/report_page.h"

#include <algorithm>
#include <filesystem>

#include "core/command_line.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"
#include "workflow/evidence_points.h"
#include "workflow/html_text.h"
#include "workflow/misregistration_map.h"
#include "workflow/room_coverage.h"
#include "workflow/room_plan.h"
#include "workflow/search_evidence.h"

namespace roomtex {
namespace {

constexpr int kWide = 1440, kNarrow = 720;  // pixels of pictures

class Page {
 public:
  Page(Chain* chain, Json* keys) : chain_(*chain), keys_(*keys) {
    pictures_ = ReadJsonFile(chain->ReportOf("pictures"));
    align_ = ReadJsonFile(chain->ReportOf("align"));
  }

  std::string Make() {
    Verdict();
    if (HasStep("pictures")) {
      FromOutside();
      BesidePhotos();
    }
    Searches();
    if (HasStep("align")) Overlays();
    if (HasStep("texture") && HasStep("pictures")) Plans();
    Notices();
    Photos();
    Steps();
    return HtmlPage(keys_["verdict"]["headline"], body_);
  }

 private:
  // Has come to its end, in this run or before.
  bool HasStep(const std::string& name) const {
    for (const Json& step : keys_["steps"]) {
      if (step["name"] != name) continue;
      return step["state"] == "done" || step["state"] == "untrusted";
    }
    return false;
  }
  void Heading(const std::string& text) { body_ += HtmlTag("h2", text) + "\n"; }

  void Verdict() {
    const Json& verdict = keys_["verdict"];
    const std::string state = verdict["state"];
    body_ += "<header class=\"" + state + "\">" + HtmlTag("p class=\"state\"", VerdictWord(state)) +
             HtmlTag("h1", verdict["headline"]);
    for (const Json& sentence : verdict["sentences"]) body_ += HtmlTag("p", WithUnits(sentence));
    body_ += "</header>\n";
    if (!keys_["remedies"].empty()) {
      body_ += "<section class=\"todo\"><h2>What to do now</h2><ul>";
      for (const Json& remedy : keys_["remedies"]) body_ += "<li>" + HtmlRemedy(remedy) + "</li>";
      body_ += "</ul></section>\n";
    }
    body_ += "<dl class=\"facts\">";
    for (const Json& fact : keys_["facts"]) {
      body_ += "<div>" + HtmlTag("dt", fact["name"]) + HtmlTag("dd", WithUnits(fact["value"])) +
               "</div>";
    }
    body_ += "</dl>\n";
  }

  void Figure(const std::string& path, int width, const std::string& alt,
              const std::string& caption) {
    const std::string picture = HtmlPicture(path, width, alt);
    if (picture.empty()) return;
    body_ += "<figure>" + picture + HtmlTag("figcaption", caption) + "</figure>\n";
  }

  void FromOutside() {
    Heading("The room from outside");
    body_ +=
        "<p class=\"quiet\">Without its ceiling, and through the walls that turn their back. Dark: "
        "what the scanner did not see.</p><div class=\"two\">";
    for (const char* name : {"open_1", "open_2"}) {
      Figure(chain_.At("pictures/") + name + ".png", kNarrow, "The coloured room from outside",
             name == std::string("open_1") ? "From one side" : "From the other");
    }
    body_ += "</div>\n";
  }

  void BesidePhotos() {
    Heading("Photo and coloured scan");
    body_ +=
        "<p class=\"quiet\">Left a photo, right the coloured scan from the same place. They should "
        "show the same at the same place.</p>\n";
    if (!pictures_.is_object() || !pictures_.contains("pictures")) return;
    for (const Json& picture : pictures_["pictures"]) {
      const std::string file = picture["file"];
      if (!BeginsWith(file, "photo_")) continue;
      Figure(chain_.At("pictures/") + file, kWide, "Photo and coloured scan beside each other",
             picture["shows"]);
    }
  }

  void Searches() {
    if (keys_["searches"].empty()) return;
    Heading("How the place was found");
    body_ += SearchHtml(keys_["searches"]);
  }

  void Overlays() {
    const Json paths =
        align_.is_object() && align_.contains("overlays") ? align_["overlays"] : Json();
    if (!paths.is_array() || paths.empty()) return;
    Heading("The scan's edges on the photos");
    body_ +=
        "<p class=\"quiet\">Photo, the scan's intensity from its place, and the scan's edges on "
        "the photo; below, parts of it three times as large. Rings: corners of the intensity that "
        "the photo shows where the scan has them; crosses: those that it does not. Cyan lines: "
        "creases, to a tenth of a sample; a misfit of a pixel shows there. Yellow and magenta "
        "lines lie anywhere between two samples.</p>\n";
    for (const Json& path : paths) {
      if (!path.is_string()) continue;
      const std::filesystem::path file = path.get<std::string>();
      const std::string name = file.filename(), folder = file.parent_path().filename(),
                        aligned = file.parent_path().parent_path().filename();
      // Where the output folder is now, and from here.
      Figure(chain_.At(aligned + "/" + folder + "/" + name), kWide, "The scan's edges on a photo",
             name);
    }
  }

  void Plans() {
    const std::string evidence = chain_.At("textured/evidence.ply");
    if (!IsThere(evidence) || !pictures_.is_object()) return;
    const std::vector<EvidencePoint> points = ReadEvidencePoints(evidence);
    const Json& up = pictures_["up"];
    const PlanFrame frame =
        MakePlanFrame(points, {up[0].get<double>(), up[1].get<double>(), up[2].get<double>()},
                      align_.is_object() ? align_.value("planes", Json()) : Json());
    const std::vector<PlanCamera> cameras = ReadPlanCameras(pictures_["cameras"], frame);
    const RoomCoverage coverage = MeasureCoverage(points, frame, cameras);
    keys_["coverage"] = {{"all", coverage.all},
                         {"walls_and_things", coverage.walls},
                         {"floor", coverage.floor},
                         {"ceiling", coverage.ceiling},
                         {"surface_m2", coverage.surface_m2},
                         {"unseen_m2", coverage.unseen_m2}};
    keys_["places_to_photograph"] = Json::array();
    for (const ViewingPlace& place : coverage.places) {
      keys_["places_to_photograph"].push_back(PlaceToJson(place));
    }
    WritePlan(points, frame);
    Heading("What the photos saw");
    CoverageText(coverage);
    body_ +=
        "<div class=\"two\"><figure>" +
        DrawPlan(points, frame, cameras, coverage.places, PlanShows::kCoverage) +
        "<div class=\"key\"><span><i style=\"background:#3b78b5\"></i>two photos or more</span>"
        "<span><i style=\"background:#e6a82a\"></i>one photo</span>"
        "<span><i style=\"background:#c93535\"></i>no photo</span><span>pale: floor</span></div>"
        "<figcaption>Plan, cut below the ceiling. Wedges with numbers: the photos, numbered as in "
        "the table below.</figcaption></figure><figure>" +
        DrawPlan(points, frame, cameras, {}, PlanShows::kDisagreement) +
        "<div class=\"key\"><span>photos agree<span class=\"ramp\"></span>disagree by " +
        Number(kWorstDisagreement, 0) +
        " levels or more</span><span><i style=\"background:#999\"></i>fewer than two photos</span>"
        "</div><figcaption>How far the photos disagree in colour. Red: something moved, shines, or "
        "lies a little out of place.</figcaption></figure></div>\n";
  }

  // For the page over all rooms of a site.
  void WritePlan(const std::vector<EvidencePoint>& points, const PlanFrame& frame) {
    const char name[] = "log/plan.png";
    OutputFile file(chain_.At(name));
    file.stream() << PlanPicture(points, frame, PlanShows::kCoverage);
    file.Commit();
    Json rows = Json::array();
    for (int row = 0; row < 3; ++row) {
      rows.push_back(ToJson(frame.plan_from_scan.row(row).transpose()));
    }
    keys_["plan"] = {{"picture", name},
                     {"plan_from_scan", rows},
                     {"low", ToJson(frame.low)},
                     {"size", ToJson(frame.Size())}};
  }

  void CoverageText(const RoomCoverage& coverage) {
    body_ += "<p>" + Percent(coverage.all) +
             " of the scanned surface is on a photo (walls and things " + Percent(coverage.walls) +
             ", floor " + Percent(coverage.floor) + ", ceiling " + Percent(coverage.ceiling) +
             "); about " + Number(coverage.unseen_m2, 1) + " of " + Number(coverage.surface_m2, 0) +
             " m² are on none.</p>\n";
    if (coverage.places.empty()) {
      body_ += "<p>No further photo from where somebody can stand would show much more.</p>\n";
      return;
    }
    body_ += "<p>To see more, photograph from here, along the arrow, in this order:</p><ul>";
    for (size_t i = 0; i < coverage.places.size(); ++i) {
      body_ += "<li><b>" + std::string(1, static_cast<char>('A' + i)) +
               "</b>: " + HtmlText(PlaceText(coverage.places[i])) + "</li>";
    }
    body_ += "</ul>\n";
  }

  void Notices() {
    if (keys_["notices"].empty()) return;
    Heading("What the steps noticed");
    body_ += "<ul>";
    for (const Json& notice : keys_["notices"]) {
      body_ += "<li>" + HtmlTag("b", notice["step"]) + ": " + HtmlText(notice["text"]) + "</li>";
    }
    body_ += "</ul>\n";
  }

  // Numbered as in the plan, where it is.
  std::string NumberOf(const std::string& name) const {
    if (!pictures_.is_object() || !pictures_.contains("cameras")) return "";
    std::vector<std::string> names;
    for (const Json& camera : pictures_["cameras"]) names.push_back(camera["name"]);
    std::sort(names.begin(), names.end());
    const auto found = std::find(names.begin(), names.end(), name);
    return found == names.end() ? "" : std::to_string(found - names.begin() + 1);
  }

  void Photos() {
    const Json& photos = keys_["photos"];
    if (photos.empty()) return;
    Heading("Photos");
    body_ +=
        "<p class=\"quiet\">Registered: seed = of the first photos, mapper = by COLMAP, chained = "
        "by its neighbours alone, model 1 and on = in another sparse model. Error: expected, one "
        "standard deviation. Support: share of its matches that obey the model. Exposure: brighter "
        "(+) or darker (-) than the reference photo. Off: how far it lies beside what the other "
        "photos show, pixels of the photo, median, as it came and as it was coloured with. Sharp: "
        "its detail beside that of the sharp photos. Where off: parts of the photo as it came, "
        "<span class=\"ramp\"></span> 0 to " +
        Number(kWorstShift, 0) + " px and more, empty where nothing could be compared.</p>\n";
    Corrections();
    Blurred();
    body_ +=
        "<div class=\"table\"><table><thead><tr><th class=\"n\">No.</th>"
        "<th>Photo</th><th>Registered</th><th class=\"n\">Error,<br>mm</th>"
        "<th class=\"n\">Support,<br>%</th><th class=\"n\">Exposure,<br>EV</th>"
        "<th class=\"n\">Samples</th><th class=\"n\">Off,<br>px</th>"
        "<th class=\"n\">then,<br>px</th><th class=\"n\">Sharp,<br>%</th><th>Where off</th>"
        "<th>Left out because</th></tr></thead><tbody>";
    for (const Json& photo : photos) {
      const std::string name = photo["name"];
      const std::string left_out = photo.value("left_out", "");
      const Json shift = photo.value("shift_px", Json::object());
      body_ += left_out.empty() ? "<tr>" : "<tr class=\"out\">";
      body_ += "<td class=\"n\">" + NumberOf(name) + "</td>" + HtmlTag("td", name) +
               HtmlTag("td", photo.value("registered_by", "–")) +
               HtmlCell(photo, "expected_error_mm", 1, 1) +
               HtmlCell(photo, "match_support", 100, 0) + HtmlCell(photo, "exposure_ev", 1, 1) +
               HtmlCell(photo, "samples_seen", 1, 0) + HtmlCell(shift, "before", 1, 2) +
               HtmlCell(shift, "after", 1, 2) + HtmlCell(photo, "sharpness", 100, 0) + "<td>" +
               MisregistrationMap(photo.value("shift_map_px", Json())) + "</td>" +
               HtmlTag("td", left_out) + "</tr>";
    }
    body_ += "</tbody></table></div>\n";
  }

  // What was done about photos that are off.
  void Corrections() {
    const Json& applied = keys_["registration"];
    if (!applied.is_string()) return;
    const std::string how = applied == "none"           ? ""
                            : applied == "pose_by_scan" ? "their poses and the scan's intensity"
                            : applied == "warp"         ? "their poses and a slight bend of each"
                                                        : "their poses";
    body_ += HtmlTag("p", how.empty() ? "Colours come from the photos as they stood."
                                      : "Photos that were off were corrected by " + how + ".");
  }

  void Blurred() {
    std::string names;
    for (const Json& photo : keys_["photos"]) {
      if (!photo.value("blurred", false)) continue;
      names += (names.empty() ? "" : ", ") + photo["name"].get<std::string>();
    }
    if (names.empty()) return;
    body_ += HtmlTag("p", "Blurred beside the others, so that they count less: " + names + ".");
  }

  void Steps() {
    Heading("Times and memory");
    body_ +=
        "<div class=\"table\"><table><thead><tr><th>Step</th><th></th><th class=\"n\">Time</th>"
        "<th class=\"n\">Processor</th><th class=\"n\">Memory</th></tr></thead><tbody>";
    for (const Json& step : keys_["steps"]) {
      body_ += "<tr>" + HtmlTag("td", step["name"]) + HtmlTag("td", step["does"]) +
               HtmlTag("td class=\"n\"", TimeText(step["seconds"])) +
               HtmlTag("td class=\"n\"", TimeText(step["cpu_seconds"])) +
               HtmlTag("td class=\"n\"", MemoryText(step["peak_memory_bytes"])) + "</tr>";
    }
    const Json& total = keys_["total"];
    body_ += "<tr class=\"sum\"><td>All</td><td></td>" +
             HtmlTag("td class=\"n\"", TimeText(total["seconds"])) +
             HtmlTag("td class=\"n\"", TimeText(total["cpu_seconds"])) +
             HtmlTag("td class=\"n\"", MemoryText(total["peak_memory_bytes"])) +
             "</tr></tbody></table></div>\n";
    Heading("The commands");
    const Json& versions = keys_["versions"];
    body_ += "<p class=\"quiet\">roomtex " + HtmlText(versions["roomtex"]) +
             (versions.contains("colmap") ? ", " + HtmlText(versions["colmap"]) : "") +
             ". Typed one after the other they do the same.</p>\n";
    for (const Json& step : keys_["steps"]) {
      body_ += HtmlTag("h3", step["name"]);
      for (const Json& note : step["notes"]) {
        body_ += "<p class=\"quiet small\">" + HtmlText(note) + "</p>";
      }
      std::string lines;
      for (const Json& line : step["commands"]) {
        lines += (lines.empty() ? "" : "\n") + line.get<std::string>();
      }
      body_ += HtmlTag("pre", lines) + "\n";
    }
    body_ += HtmlTag("h3", "all of it") + HtmlTag("pre", keys_["command_line"]) + "\n";
  }

  Chain& chain_;
  Json& keys_;
  Json pictures_, align_;
  std::string body_;
};

}  // namespace

void WriteReportPage(Chain* chain, Json* keys) {
  const std::string page = Page(chain, keys).Make();
  OutputFile file(chain->At("report.html"));
  file.stream() << page;
  file.Commit();
}

}  // namespace roomtex
