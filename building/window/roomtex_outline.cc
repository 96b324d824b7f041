// roomtex-outline: buildings from the points of a model or a cloud (thesis 9.3).

#include <filesystem>

#include "building/building_output.h"
#include "building/building_solid.h"
#include "building/outline.h"
#include "building/outline_cloud.h"
#include "building/outline_proposal.h"
#include "core/command_line.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/standard_files.h"
#include "core/text.h"
#include "importers/scan_record.h"
#ifdef ROOMTEX_PAGES
#include "building/window/outline_window.h"
#include "core/local_server.h"
#include "outline_page.h"
#endif

namespace roomtex {
namespace {

namespace fs = std::filesystem;

struct OutlineArguments {
  OutlineInputOptions input;
  ProposalOptions proposal;
  std::string outline_path, output_path;
  std::vector<std::string> model_paths;
  bool accept_untrusted = false;
#ifdef ROOMTEX_PAGES
  bool window = false;
  LocalServerOptions server;
#endif
};

void AddOutlineOptions(OutlineArguments* a, Command* command) {
  command->AddInputPath("input_path", &a->input.input_path,
                        "The points: a COLMAP model (folder), or a cloud, scan or mesh that "
                        "roomtex-import reads (.ply, .pcd, .e57, ...). Not needed to extrude an "
                        "--outline_path.",
                        Command::Kind::kOptional);
  command->AddInputPath("outline_path", &a->outline_path,
                        "Buildings as they stand in this outline.json, drawn or changed by hand: "
                        "nothing is proposed.",
                        Command::Kind::kOptional);
  command->AddOutputPath("output_path", &a->output_path,
                         "The buildings, outline.json: footprints, floors and roofs, to be edited "
                         "if need be. One that somebody edited is not replaced.");
  command->AddOutputPaths(
      "model_path", &a->model_paths,
      std::string("The buildings as solids, by extension: ") + BuildingExtensions() + ".",
      Command::Kind::kOptional);
  command->Add(FieldsOf(&a->input));
  command->Add(FieldsOf(&a->proposal));
  command->AddBool("accept_untrusted", &a->accept_untrusted, kAcceptUntrustedHelp);
#ifdef ROOMTEX_PAGES
  command->AddBool("window", &a->window,
                   "Opens the page in which outlines are drawn and changed; it saves to "
                   "--output_path after every change, and goes on with what is there.");
  command->Add(FieldsOf(&a->server));
#endif
}

// Options that were given and that nothing asks for.
std::vector<std::string> IdleOptions(const OutlineArguments& a, bool window) {
  std::vector<std::string> idle;
  if (a.outline_path.empty() || window) return idle;
  const auto add = [&idle](bool given, const char* option) {
    if (given) idle.emplace_back(option);
  };
  const OutlineInputOptions input;
  const ProposalOptions proposal;
  if (a.input.input_path.empty()) {
    add(a.input.sparse_path != input.sparse_path, "--sparse_path");
    add(a.input.up != input.up, "--up");
    add(a.input.scale != input.scale, "--scale");
  }
  add(a.proposal.area != proposal.area, "--area");
  add(a.proposal.min_area != proposal.min_area, "--min_area");
  add(a.proposal.right_angles != proposal.right_angles, "--right_angles");
  return idle;
}

// --outline_path, on the Earth if --geo_origin says where.
Outline ReadGivenOutline(const OutlineArguments& a) {
  Outline outline = ReadOutline(a.outline_path);
  if (const auto origin = a.input.GeoOrigin()) PlaceOnEarth(*origin, a.outline_path, &outline);
  return outline;
}

// What the buildings' model says of itself holds of them, too.
void TakeOverAlignment(const Outline& outline, const std::string& path, bool accept,
                       const Command::Context& context) {
  if (!outline.alignment) return;
  AlignmentRecord record;
  record.folder = path;
  record.trusted = outline.alignment->trusted;
  record.reason = outline.alignment->reason;
  TakeOverTrust(record, accept, context);
  if (outline.geo && outline.alignment->north_assumed) {
    context.Warn(
        "which way is north was assumed, not measured: roomtex-align had no surveyed station and "
        "no heading in --geo_origin. The buildings may be turned about their place by any angle");
  }
}

void CheckOutlineArguments(const OutlineArguments& a) {
  std::vector<std::string> problems = a.input.Problems();
  AppendProblems(a.proposal.Problems(), &problems);
  bool window = false;
#ifdef ROOMTEX_PAGES
  AppendProblems(a.server.Problems(), &problems);
  window = a.window;
#endif
  for (const std::string& path : a.model_paths) {
    if (!IsBuildingPath(path)) {
      problems.push_back("--model_path " + path + " must end with " + BuildingExtensions());
    }
  }
  if (a.input.input_path.empty() && a.outline_path.empty()) {
    problems.push_back("give --input_path (points) or --outline_path (buildings), or both");
  }
  if (a.input.input_path.empty() && window) {
    problems.push_back("--window needs the points: give --input_path");
  }
  for (const std::string& option : IdleOptions(a, window)) {
    problems.push_back(option + " says nothing here: with --outline_path " +
                       (a.input.input_path.empty() ? "and without --input_path there are no points "
                                                     "to read"
                                                   : "nothing is proposed"));
  }
  ThrowIfProblems(problems);
  if (fs::is_directory(a.output_path)) {
    throw InputError(a.output_path, "", "is a folder", "Name a file for the outline: outline.json");
  }
  // What is extruded or judged is written as it was read: the same line a second time.
  const auto is_copy = [&] {
    return !a.outline_path.empty() && HoldsSameOutline(a.output_path, ReadGivenOutline(a));
  };
  if (!window && WasEdited(a.output_path) && !is_copy()) {
    throw InputError(a.output_path, "",
                     "is there already and was edited, or is another file: it is not replaced",
                     "Write to another --output_path, and give it as --outline_path to extrude it");
  }
}

Json NumberOrNull(bool known, double value) { return known ? Json(value) : Json(nullptr); }

Json BuildingToJson(const OutlineBuilding& building, const BuildingEvidence* evidence) {
  const BuildingSolid solid = ExtrudeBuilding(building);
  const auto [eaves, ridge] = solid.RoofHeights();
  Json json;
  json["name"] = building.name;
  json["roof"] = building.RoofShape();
  json["ground"] = building.ground;
  json["eaves"] = eaves;
  json["ridge"] = ridge;
  json["volume"] = solid.Volume();
  json["corners"] = Json::array();
  for (size_t i = 0; i < building.footprint.size(); ++i) {
    Json corner;
    corner["x"] = building.footprint[i].x();
    corner["y"] = building.footprint[i].y();
    corner["sigma"] = NumberOrNull(evidence != nullptr, evidence ? evidence->corner_sigma[i] : 0);
    json["corners"].push_back(corner);
  }
  if (evidence == nullptr) return json;
  json["walls"] = Json::array();
  for (const BuildingEvidence::Wall& wall : evidence->walls) {
    json["walls"].push_back({{"length", wall.length},
                             {"covered", wall.covered},
                             {"num_points", wall.num_points},
                             {"rms", wall.rms}});
  }
  json["ground_sigma"] = evidence->ground_sigma;
  json["roof_sigma"] = evidence->roof_sigma;
  json["roof_rms"] = evidence->roof_rms;
  json["roof_covered"] = evidence->roof_covered;
  json["num_points"] = evidence->num_points;
  json["explained"] = evidence->explained;
  json["trusted"] = evidence->doubts.empty();
  json["doubts"] = evidence->doubts;
  return json;
}

void ReportOutline(const OutlineProposal& proposal, bool judged, const Command::Context& context) {
  const Outline& outline = proposal.outline;
  context.report["num_buildings"] = outline.buildings.size();
  context.report["unit"] = outline.Unit();
  context.report["outline_from_input"] = ToJson(outline.outline_from_input);
  context.report["geo_origin"] = OutlineToJson(outline)["geo_origin"];
  context.report["explained"] = NumberOrNull(judged, proposal.explained);
  context.report["buildings"] = Json::array();
  for (size_t i = 0; i < outline.buildings.size(); ++i) {
    context.report["buildings"].push_back(
        BuildingToJson(outline.buildings[i], judged ? &proposal.evidence[i] : nullptr));
  }
}

void SayDoubts(const OutlineProposal& proposal, const UpFinding& up,
               const Command::Context& context) {
  const std::vector<OutlineBuilding>& buildings = proposal.outline.buildings;
  if (!up.trusted) {
    context.report.SetUntrusted(
        "what points up is a guess: say it with --up, or give the model of a cloud as "
        "--sparse_path.");
  }
  if (buildings.empty()) {
    context.report.SetUntrusted(
        "no building was found in the points: draw them with --window, or give more points of "
        "walls and roofs.");
  }
  for (size_t i = 0; i < buildings.size(); ++i) {
    for (const std::string& doubt : proposal.evidence[i].doubts) {
      context.report.SetUntrusted("building " + buildings[i].name + ": " + doubt + ".");
    }
  }
}

void PrintOutline(const OutlineProposal& proposal, bool judged) {
  for (size_t i = 0; i < proposal.outline.buildings.size(); ++i) {
    const OutlineBuilding& building = proposal.outline.buildings[i];
    const Json json = BuildingToJson(building, judged ? &proposal.evidence[i] : nullptr);
    AnswerAtEnd(building.name + ": " + std::to_string(building.footprint.size()) + " corners, " +
                building.RoofShape() + " roof, ground " + Number(building.ground, 2) + ", eaves " +
                Number(json["eaves"].get<double>(), 2) + ", ridge " +
                Number(json["ridge"].get<double>(), 2) +
                (judged && !proposal.evidence[i].doubts.empty() ? ", doubtful" : "") + "\n");
  }
}

void WriteModels(const OutlineArguments& a, const Outline& outline) {
  for (const std::string& path : a.model_paths) WriteBuildings(path, outline);
}

void MakeOutline(const OutlineArguments& a, const Command::Context& context) {
  CheckOutlineArguments(a);
  if (a.input.input_path.empty()) {
    // A person's buildings, without points to compare them with.
    OutlineProposal drawn;
    drawn.outline = ReadGivenOutline(a);
    TakeOverAlignment(drawn.outline, a.outline_path, a.accept_untrusted, context);
    CommitFilesAtEnd();
    ReportOutline(drawn, false, context);
    WriteModels(a, drawn.outline);
    WriteOutline(a.output_path, drawn.outline, false);
    PrintOutline(drawn, false);
    return;
  }
  const std::string model_folder =
      fs::is_directory(a.input.input_path) ? a.input.input_path : a.input.sparse_path;
  const int threads = context.options.num_threads;
  context.progress.Stage("read points");
  OutlineCloud cloud = ReadOutlineCloud(a.input, threads);
  TakeOverAlignment(cloud.frame, model_folder, a.accept_untrusted, context);
  context.progress.Stage("find planes");
  std::vector<PlaneSegment> segments =
      FindPlaneSegments(cloud, static_cast<uint64_t>(context.options.random_seed), threads);
  const UpFinding up = Level(&cloud, &segments);
  context.report["num_points"] = cloud.num_read;
  context.report["num_points_used"] = cloud.points.size();
  context.report["up"] = {{"direction", ToJson(Eigen::VectorXd(up.up_in_input))},
                          {"source", up.source},
                          {"spread_deg", up.spread_deg},
                          {"num_walls", up.num_walls},
                          {"trusted", up.trusted}};
  if (!cloud.frame.metric) {
    context.Warn(
        "the scale is not known: lengths are in units of the input. Give --scale, or a model of "
        "roomtex-align");
  }
#ifdef ROOMTEX_PAGES
  if (a.window) {
    if (!a.outline_path.empty() && fs::exists(a.output_path)) {
      context.Warn("--outline_path is not used: " + a.output_path +
                   " is there already, and the window goes on with it");
    }
    const OutlineWindowInput window{a.proposal,         a.server,      kOutlinePage,
                                    a.outline_path,     a.output_path, a.model_paths,
                                    a.input.GeoOrigin()};
    const bool model_says = cloud.frame.alignment.has_value();
    const OutlineProposal drawn =
        RunOutlineWindow(window, std::move(cloud), std::move(segments), context);
    if (!model_says) {
      TakeOverAlignment(drawn.outline, a.output_path, a.accept_untrusted, context);
    }
    WriteModels(a, drawn.outline);
    ReportOutline(drawn, true, context);
    return;
  }
#endif
  OutlineProposal proposal;
  if (a.outline_path.empty()) {
    context.progress.Stage("propose buildings");
    proposal = ProposeOutline(cloud, segments, a.proposal);
  } else {
    context.progress.Stage("compare with points");
    Outline outline = ReadGivenOutline(a);
    if (cloud.frame.alignment) {
      outline.alignment = cloud.frame.alignment;  // as it is now
    } else {
      TakeOverAlignment(outline, a.outline_path, a.accept_untrusted, context);
    }
    AdoptFrame(outline, &cloud, &segments);
    proposal = JudgeOutline(cloud, segments, outline);
  }
  context.progress.Finish();
  CommitFilesAtEnd();
  ReportOutline(proposal, true, context);
  WriteModels(a, proposal.outline);
  WriteOutline(a.output_path, proposal.outline, a.outline_path.empty());
  PrintOutline(proposal, true);
  SayDoubts(proposal, up, context);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::OutlineArguments arguments;
  roomtex::Command command(
      "roomtex-outline", "Buildings from the points of a model: footprints, roofs, solids.",
      "roomtex-outline --input_path sparse/0 --output_path outline.json --model_path building.glb");
  roomtex::AddOutlineOptions(&arguments, &command);
#ifdef ROOMTEX_PAGES
  roomtex::LetPortDiffer(argc, argv, &arguments.server);
#endif
  return command.Run(argc, argv, [&](const roomtex::Command::Context& context) {
    roomtex::MakeOutline(arguments, context);
  });
}
