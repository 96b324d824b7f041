// outline_accuracy [FOLDER]: the table of docs/outline.md: simulated streets, and what the library
// of roomtex-outline makes of them; models and a dense cloud stay in FOLDER.
// outline_accuracy --street FOLDER: the model of one street alone, for tests.

#include <cstdio>
#include <string>

#include <fmt/core.h>

#include "building/outline_cloud.h"
#include "building/outline_proposal.h"
#include "core/output_file.h"
#include "tests/building/simulated_street.h"

namespace roomtex {
namespace {

void Measure(const std::string& name, StreetOptions options, const std::string& folder) {
  for (int seed = 1; seed <= 3; ++seed) {
    options.seed = seed;
    const SimulatedStreet street = MakeStreet(options);
    WriteSparseModel(street.model, folder + "/street");
    OutlineInputOptions input;
    input.input_path = folder + "/street";
    input.scale = 1;
    OutlineCloud cloud = ReadOutlineCloud(input, -1);
    std::vector<PlaneSegment> segments = FindPlaneSegments(cloud, 0, -1);
    Level(&cloud, &segments);
    const OutlineProposal proposal = ProposeOutline(cloud, segments, {});
    const StreetErrors errors =
        CompareStreet(street.truth, proposal.outline, cloud.frame.outline_from_input);
    size_t doubtful = 0;
    for (const BuildingEvidence& evidence : proposal.evidence) doubtful += !evidence.doubts.empty();
    fmt::print("| {} {} | {} | {} | {} | {} | {:.4f} | {:.4f} | {:.4f} | {:.4f} |\n", name, seed,
               street.model.points.size(), proposal.outline.buildings.size(), errors.missed,
               doubtful, errors.corner, errors.ground, errors.eaves, errors.ridge);
    std::fflush(stdout);
    const std::string kept = folder + "/" + name + " " + std::to_string(seed);
    WriteOutline(kept + ".json", proposal.outline, true);
    WriteSparseModel(street.model, kept);
  }
}

int Main(const std::string& folder) {
  MakeFolder(folder);
  fmt::print(
      "| street | points | buildings | missed | doubtful | corner | ground | eaves | ridge |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  StreetOptions options;
  Measure("as it is", options, folder);
  options.features_per_m2 = 2;
  Measure("few points", options, folder);
  options = {};
  options.depth_error = 0.004;
  Measure("twice the noise", options, folder);
  options = {};
  options.ground_slope = 0.04;
  Measure("sloping street", options, folder);
  options = {};
  options.bare_house = 1;
  Measure("bare rear wall", options, folder);
  options = {};
  options.photos_from_above = false;
  Measure("from the street alone", options, folder);
  options = {};
  options.mock_up = true;
  Measure("mock-up", options, folder);
  options = {};
  const SparseModel model = MakeStreet(options).model;
  WriteSparseModel(model, folder + "/street");
  WriteStreetPhotos(options, model, folder + "/photos", -1);
  WriteCloud(MakeDenseStreet(options, 3000000), folder + "/dense.ply");
  return 0;
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--street") {
    roomtex::MakeFolder(argv[2]);
    roomtex::WriteSparseModel(roomtex::MakeStreet({}).model, std::string(argv[2]) + "/street");
    return 0;
  }
  if (argc > 2 || (argc == 2 && argv[1][0] == '-')) {
    std::fprintf(stderr, "usage: outline_accuracy [FOLDER] | --street FOLDER\n");
    return 2;
  }
  return roomtex::Main(argc > 1 ? argv[1] : "outline_accuracy");
}
