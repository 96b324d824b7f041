#pragma once
// The page of roomtex-outline: contours drawn and changed over the points, in a browser
// (thesis 9.3, steps 1 to 5). The paths that it serves: building/README.md.

#include <optional>
#include <string>
#include <vector>

#include "building/outline_proposal.h"
#include "core/command_line.h"
#include "core/local_server.h"
#include "core/page.h"

namespace roomtex {

struct OutlineWindowInput {
  const ProposalOptions& proposal;
  const LocalServerOptions& server;
  const Page& page;
  // What to begin with: output_path if it is there, else outline_path, else a proposal.
  std::string outline_path, output_path;
  std::vector<std::string> model_paths;
  std::optional<GeoPosition> geo_origin;  // --geo_origin, for what is read (PlaceOnEarth())
};

// Serves until it is stopped; every change is saved to output_path, the file that was there is kept
// as it was with .bak behind its name. cloud: level. Gives the last buildings.
OutlineProposal RunOutlineWindow(const OutlineWindowInput& input, OutlineCloud cloud,
                                 std::vector<PlaneSegment> segments,
                                 const Command::Context& context);

}  // namespace roomtex
