#include "workflow/align_remedies.h"

#include <algorithm>

#include "core/child_program.h"

namespace roomtex {
namespace {

constexpr char kCheckRoom[] =
    "Check that photos and scan are of the same room, and that nothing large was moved between";

std::string CommandWith(const AutoOptions& options) {
  return CommandText(Chain(options).AutoCommand());
}

std::string StartAgain(const AutoOptions& options) {
  return "Then start again, it goes on from here: " + CommandWith(options);
}

// Of a scan that is the wrong way round: the reason says how to read it, and picks would not help.
std::vector<std::string> MirroredRemedies(AutoOptions options) {
  if (options.azimuth == "auto") return {StartAgain(options)};
  options.azimuth = "auto";
  return {"Start again without --azimuth, so that it is found: " + CommandWith(options)};
}

// Picks that were made on it are as wrong.
std::vector<std::string> MirroredPicksRemedies(AutoOptions options) {
  options.azimuth = "auto";
  std::vector<std::string> remedies = MirroredRemedies(options);
  remedies.insert(remedies.begin(), "Pick anew, in the scan as it is read then: " +
                                        CommandText(Chain(options).PickCommand()));
  return remedies;
}

// Where a pick or --near decides: between several places, or that photos and scan are of one room.
std::vector<std::string> HintRemedies(const Chain& chain, bool several) {
  AutoOptions options = chain.options();
  std::vector<std::string> remedies;
  remedies.push_back(
      std::string(several
                      ? "Pick one point that photo and scan both show, where these places differ"
                      : "If photos and scan are of one room, pick one point that both show") +
      "; the rest is found: " + CommandText(chain.PickCommand()));
  remedies.push_back(StartAgain(options));
  if (!options.near.empty()) return remedies;
  options.near = "PHOTO,X,Y,Z";
  remedies.push_back(std::string("Or, without a click") +
                     (several ? " and where these places lie far apart" : "") +
                     ", name a photo and a place of the scan that it shows (metres, scan frame): " +
                     CommandWith(options));
  return remedies;
}

// Scans that do not fit together, and were not registered anew.
bool StationsDisagree(const Json& report) {
  const Json pairs = report.is_object() ? report.value("stations", Json()) : Json();
  return std::any_of(pairs.begin(), pairs.end(),
                     [](const Json& pair) { return !pair.value("agree", true); });
}

std::string RegisterStationsRemedy(AutoOptions options) {
  options.register_stations = true;
  return "Let the scans that do not fit together be registered anew: " + CommandWith(options);
}

}  // namespace

std::vector<std::string> AlignRemedies(const Chain& chain, const Json& report) {
  const Json found = report.is_object() ? report.value("search", Json()) : Json();
  const Json search = found.is_object() ? found : Json::object();
  const std::string verdict = search.value("verdict", "");
  const Json mirrored = report.is_object() ? report.value("mirrored", Json()) : Json();
  if (mirrored == "scan and picks") return MirroredPicksRemedies(chain.options());
  if (verdict == "mirrored" || mirrored == "scan") return MirroredRemedies(chain.options());
  if (search.value("hint_decides", false)) return HintRemedies(chain, verdict == "ambiguous");
  std::vector<std::string> remedies;
  if (!chain.options().register_stations && StationsDisagree(report)) {
    remedies.push_back(RegisterStationsRemedy(chain.options()));
  }
  if (verdict == "none" || verdict == "weak" || verdict == "photos contradict") {
    remedies.emplace_back(kCheckRoom);
  }
  if (!chain.options().near.empty() && verdict != "open") {
    remedies.push_back("Check the hint, --near " + chain.options().near);
  }
  const char* what = "Pick six points that photo and scan both show: ";
  if (!chain.PicksPath().empty()) {
    what = search.empty() ? "Look at the picks and mend them: "
                          : "Look at the picks, mend them, and add others, six in all: ";
  } else if (verdict == "open") {
    what =
        "Pick six points that photo and scan both show, on surfaces that face different ways if "
        "there are some; they hold what the surface leaves open: ";
  }
  remedies.push_back(what + CommandText(chain.PickCommand()));
  remedies.push_back(StartAgain(chain.options()));
  return remedies;
}

}  // namespace roomtex
