// roomtex-pairs: the image pairs worth matching, instead of all.

#include <cctype>
#include <cmath>
#include <filesystem>

#include <fmt/core.h>

#include "colmap_ext/pair_selection.h"
#include "core/command_line.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/photo.h"
#include "core/standard_files.h"
#include "core/text.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

struct PairsCommandOptions {
  std::string database_path, image_path, output_path, graph_path;
  PairOptions pairs;
};

constexpr double kMetresPerDegree = 111320;  // of latitude

// COLMAP reads its list of pairs word by word.
void RequireNamesWithoutBlanks(const std::map<uint32_t, DatabaseImage>& images,
                               const std::string& database_path) {
  for (const auto& [image_id, image] : images) {
    for (const char c : image.name) {
      if (std::isspace(static_cast<unsigned char>(c)) == 0) continue;
      throw InputError(database_path, "image " + Quoted(image.name),
                       "has a blank in its name, which COLMAP's list of pairs cannot hold",
                       "Rename the photos and run colmap feature_extractor again, or use colmap "
                       "exhaustive_matcher");
    }
  }
}

std::vector<PhotoHint> ReadHints(const std::map<uint32_t, DatabaseImage>& images,
                                 const std::string& image_path, const Command::Context& context) {
  if (image_path.empty()) return {};
  RequireFolder(image_path, "Check --image_path: the folder given to colmap feature_extractor");
  context.progress.Stage("read EXIF", static_cast<int>(images.size()));
  std::vector<PhotoHint> hints;
  std::optional<GpsData> origin;
  size_t num_missing = 0;
  for (const auto& [image_id, image] : images) {
    PhotoHint hint;
    const std::string path = (fs::path(image_path) / image.name).string();
    std::error_code error;
    if (!fs::is_regular_file(path, error)) {
      ++num_missing;
    } else {
      hint.date_time = ReadExposureData(path).date_time;
      if (const std::optional<GpsData> gps = ReadGpsData(path)) {
        if (!origin) origin = gps;
        const double east = gps->longitude_deg - origin->longitude_deg;
        hint.place = {kMetresPerDegree * std::remainder(east, 360.0) *
                          std::cos(gps->latitude_deg * kPi / 180),
                      kMetresPerDegree * (gps->latitude_deg - origin->latitude_deg)};
      }
    }
    hints.push_back(hint);
    context.progress.Tick();
  }
  if (num_missing > 0) {
    context.Warn(std::to_string(num_missing) + " of " + std::to_string(images.size()) +
                 " photos are not in " + image_path + ": they are paired without EXIF");
  }
  return hints;
}

void WritePairs(const PairSelection& selection, const std::string& path) {
  OutputFile file(path);
  for (const PairEdge& edge : selection.edges) {
    if (!edge.listed) continue;
    file.stream() << selection.photos[static_cast<size_t>(edge.photo1)].name << ' '
                  << selection.photos[static_cast<size_t>(edge.photo2)].name << '\n';
  }
  file.Commit();
}

Json GraphJson(const PairSelection& selection) {
  Json graph;
  graph["nodes"] = Json::array();
  for (const PairPhoto& photo : selection.photos) {
    graph["nodes"].push_back({{"name", photo.name},
                              {"num_features", photo.num_features},
                              {"group", photo.group},
                              {"num_pairs", photo.num_pairs}});
  }
  graph["edges"] = Json::array();
  for (const PairEdge& edge : selection.edges) {
    graph["edges"].push_back({{"name1", selection.photos[static_cast<size_t>(edge.photo1)].name},
                              {"name2", selection.photos[static_cast<size_t>(edge.photo2)].name},
                              {"found_by", PairSourceName(edge.source)},
                              {"num_matches", edge.num_matches},
                              {"num_inliers", edge.num_inliers},
                              {"agrees", edge.agrees},
                              {"in_database", edge.in_database},
                              {"listed", edge.listed}});
  }
  return graph;
}

Json NamesOf(const std::vector<int>& photos, const PairSelection& selection) {
  Json names = Json::array();
  for (const int photo : photos) {
    names.push_back(selection.photos[static_cast<size_t>(photo)].name);
  }
  return names;
}

// What stands apart, in words; counts and names in the report.
void ReportGroups(const PairSelection& selection, const Command::Context& context) {
  Json groups = Json::array(), isolated = Json::array(), lookalikes = Json::array();
  std::string names;
  for (const std::vector<int>& group : selection.groups) {
    if (group.size() > 1) {
      groups.push_back(NamesOf(group, selection));
      continue;
    }
    const PairPhoto& photo = selection.photos[static_cast<size_t>(group[0])];
    isolated.push_back(
        {{"name", photo.name},
         {"reason", photo.num_features == 0 ? "has no features" : "no photo agrees with it"}});
    constexpr size_t kNumShown = 8;
    if (isolated.size() <= kNumShown) names += (names.empty() ? "" : ", ") + photo.name;
    if (isolated.size() == kNumShown + 1) names += " ...";
  }
  if (!isolated.empty()) {
    context.Warn(std::to_string(isolated.size()) +
                 " photos stand alone, nothing agrees with them: " + names);
  }
  int num_lookalikes = 0;
  for (const GroupLookalike& one : selection.lookalikes) {
    lookalikes.push_back({{"groups", {one.group1, one.group2}}, {"num_pairs", one.num_pairs}});
    num_lookalikes += one.num_pairs;
  }
  if (num_lookalikes > 0) {
    context.Warn(std::to_string(num_lookalikes) +
                 " pairs of different groups agree on large things and not on the small ones "
                 "between them, as the same furniture in two rooms does: left out. If it is one "
                 "room, take photos between the groups, or give --Pairs.join_lookalikes");
  }
  context.report["groups"] = groups;
  context.report["isolated"] = isolated;
  context.report["lookalikes"] = lookalikes;
  if (groups.size() > 1) {
    context.Warn("the photos fall into " + std::to_string(groups.size()) +
                 " groups that nothing connects (report, groups): other rooms, or photos between "
                 "them are missing");
  }
}

void FindPairs(const PairsCommandOptions& options, const Command::Context& context) {
  ThrowIfProblems(options.pairs.Problems());
  context.progress.Stage("read database");
  const Database database(options.database_path);
  const std::map<uint32_t, DatabaseImage> images = database.ReadImages();
  RequireNamesWithoutBlanks(images, options.database_path);
  const std::vector<PhotoHint> hints = ReadHints(images, options.image_path, context);
  const PairSelection selection =
      SelectPairs(database, hints, options.pairs, EffectiveThreads(context.options.num_threads),
                  static_cast<uint64_t>(context.options.random_seed), &context.progress);
  context.progress.Stage("write pairs");
  CommitFilesAtEnd();
  WritePairs(selection, options.output_path);
  if (!options.graph_path.empty()) WriteJson(options.graph_path, GraphJson(selection));

  size_t num_listed = 0, num_agreeing = 0;
  for (const PairEdge& edge : selection.edges) {
    num_listed += edge.listed;
    num_agreeing += edge.agrees;
  }
  const size_t num_images = images.size();
  context.report["num_images"] = num_images;
  context.report["num_pairs"] = num_listed;
  context.report["num_possible_pairs"] = num_images * (num_images - 1) / 2;
  context.report["num_checked"] = selection.num_checked;
  context.report["num_agreeing"] = num_agreeing;
  context.report["num_in_database"] = selection.num_in_database;
  ReportGroups(selection, context);
  AnswerAtEnd(fmt::format("{}: {} of {} pairs, {} photos in {} groups\n", options.output_path,
                          num_listed, num_images * (num_images - 1) / 2, num_images,
                          selection.groups.size()));
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  PairsCommandOptions options;
  Command command("roomtex-pairs",
                  "Finds the image pairs worth matching, in the time of a few: for colmap "
                  "matches_importer --match_type pairs.",
                  "roomtex-pairs --database_path database.db --output_path pairs.txt");
  command.AddInputPath("database_path", &options.database_path,
                       "COLMAP's database with features (colmap feature_extractor). Only read.");
  command.AddOutputPath("output_path", &options.output_path,
                        "Where to write the list: two names a line, for colmap matches_importer "
                        "--match_list_path.");
  command.AddInputPath("image_path", &options.image_path,
                       "Folder of the photos, to go by their EXIF time and GPS, too.",
                       Command::Kind::kOptional);
  command.AddOutputPath("graph_path", &options.graph_path,
                        "Where to write the graph (JSON): photos, and pairs with how they were "
                        "found and what they agree on.",
                        Command::Kind::kOptional);
  command.Add(FieldsOf(&options.pairs));
  return command.Run(argc, argv,
                     [&](const Command::Context& context) { FindPairs(options, context); });
}
