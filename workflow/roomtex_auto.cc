// roomtex-auto: from photos and a scan to a coloured room and a report, with one command.

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <unistd.h>

#include "core/child_program.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/near_hint.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/partial_path.h"
#include "core/photo_files.h"
#include "core/photo_fit.h"
#include "core/standard_files.h"
#include "workflow/auto_options.h"
#include "workflow/chain.h"
#include "workflow/output_folder.h"
#include "workflow/passed_options.h"
#include "workflow/report_data.h"
#include "workflow/report_page.h"
#include "workflow/run_steps.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

void AddOptions(AutoOptions* o, Command* command) {
  const auto optional = Command::Kind::kOptional;
  command->AddInputPath("image_path", &o->image_path, "Folder of the photos.", optional);
  command->AddInputPath("panoramas_path", &o->panoramas_path,
                        "Instead: folder of panoramas (equirectangular).", optional);
  command->AddInputPath("video_path", &o->video_path, "Instead: a video.", optional);
  command->AddInputPaths("scan_path", &o->scan_paths, "Range scan, e.g. .e57, .ptx, .rtpi, .ply.",
                         Command::Kind::kRequired);
  command->AddInputPath("scan_poses", &o->scan_poses,
                        "Where the scanners stood, as roomtex-align has it.", optional);
  command->AddChoice("azimuth", &o->azimuth, {"auto", "clockwise", "counterclockwise"},
                     "RTPI: sense in which the azimuth grows, as roomtex-align has it.");
  command->AddChoice("up_axis", &o->up_axis, {"auto", "x", "y", "z", "-x", "-y", "-z"},
                     "Axis of the scan's coordinates that points up, as roomtex-align has it.");
  command->AddString("units", &o->units,
                     "Unit of the lengths in the scan, as roomtex-align has it; not given = what "
                     "the file says.");
  command->AddOutputPath("output_path", &o->output_path,
                         "Folder for all that is made: database.db, sparse, aligned, textured, "
                         "report.html, report.json, log. Started again, it goes on from there.");
  command->AddInputPath("picks_path", &o->picks_path,
                        "Picks of roomtex-pick; not given = picks.csv in the output folder if it "
                        "is there, else without clicks.",
                        optional);
  command->AddString("near", &o->near, kNearHelp);
  command->AddInputPath("cameras_path", &o->cameras_path,
                        "The calibrated camera: cameras.txt of roomtex-calibrate.", optional);
  command->AddString("camera_model", &o->camera_model,
                     "COLMAP's model of the camera; not given = OPENCV, of fewer than 10 photos "
                     "SIMPLE_RADIAL.");
  command->AddString("camera_params", &o->camera_params,
                     "Its parameters with commas between them, if they are known.");
  command->Add(FieldsOf(o));
  command->AddString(
      "from", &o->from,
      "Run this step and those behind it again, and take those before as they are: "
      "frames, faces, associate, scanner, features, matches, mapper, align, texture, "
      "pictures, report.");
  command->AddString("until", &o->until, "Stop behind this step.");
  command->AddString("only", &o->only, "Run this step alone, again.");
  command->AddString("colmap", &o->colmap, "COLMAP's program: a path, or a name on the PATH.");
  PassedOptions& passed = o->passed;
  for (const char* prefix : {"--ImageReader.", "--SiftExtraction.", "--FeatureExtraction."}) {
    command->PassThrough(prefix, &passed.features, "Handed on to colmap feature_extractor.");
  }
  command->PassThrough("--Pairs.", &passed.pairs, "Handed on to roomtex-pairs.");
  for (const char* prefix : {"--SiftMatching.", "--FeatureMatching.", "--TwoViewGeometry.",
                             "--ExhaustiveMatching.", "--SequentialMatching."}) {
    command->PassThrough(prefix, &passed.matches, "Handed on to COLMAP's matcher.");
  }
  for (const char* prefix : {"--Mapper.", "--Init.", "--Chain.", "--Groups.", "--Rooms."}) {
    command->PassThrough(prefix, &passed.mapper, "Handed on to roomtex-mapper.");
  }
  for (const char* prefix :
       {"--Picks.", "--Plane.", "--PlaneBA.", "--Patches.", "--Fit.", "--Scale.", "--Trust."}) {
    command->PassThrough(prefix, &passed.align, "Handed on to roomtex-align.");
  }
  for (const char* prefix : {"--Texture.", "--Exposure.", "--Registration.", "--Blend.",
                             "--Occlusion.", "--Surface.", "--Mesh."}) {
    command->PassThrough(prefix, &passed.texture, "Handed on to roomtex-texture.");
  }
}

// One run at a time in an output folder.
class FolderLock {
 public:
  explicit FolderLock(const std::string& folder)
      : file_(open((folder + "/log/lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666)) {
    if (file_ < 0) {
      throw InputError(folder, "",
                       std::string("cannot be written into (") + std::strerror(errno) + ")",
                       "Check the rights of this folder");
    }
    if (flock(file_, LOCK_EX | LOCK_NB) == 0) return;
    close(file_);
    throw InputError(folder, "", "another roomtex-auto works in it",
                     "Wait for it, or give another --output_path");
  }
  ~FolderLock() { close(file_); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int file_;
};

// What commands that were killed have left of files that they had not finished.
void TidyUp(const std::string& output_path) {
  for (const char* folder :
       {"", "/sparse", "/aligned", "/textured", "/pictures", "/log", "/faces", "/scanner"}) {
    RemoveLeftovers(output_path + folder);
  }
}

// What is not there cannot be in the sparse model, either. Photos of a video have no names yet, and
// those of which every place was taken twice get common ones.
void CheckNear(const AutoOptions& o) {
  const std::string name = ParseNearHint(o.near).image_name;
  const std::string& folder = o.image_path.empty() ? o.panoramas_path : o.image_path;
  if (folder.empty() || IsThere(folder + "/" + name)) return;
  if (IsThere(o.output_path + "/linked/plain/" + name)) return;
  throw UsageError("--near names " + name + ", which is not in " + folder);
}

void CheckInputs(const AutoOptions& o) {
  if (!o.image_path.empty()) RequireFolder(o.image_path, "Give the folder of the photos");
  if (!o.panoramas_path.empty()) RequireFolder(o.panoramas_path, "Give the panoramas' folder");
  if (!o.video_path.empty()) RequireFile(o.video_path, "Give a video");
  if (!o.picks_path.empty()) {
    RequireFile(o.picks_path, "Make it with roomtex-pick, or leave --picks_path out");
  }
  if (!o.near.empty()) CheckNear(o);
  if (!o.cameras_path.empty()) ReadKnownCameras(o.cameras_path);
  if (!o.scan_poses.empty()) RequireFile(o.scan_poses, "Give the file with the stations' poses");
  for (const std::string& path : o.scan_paths) {
    RequireFile(FileOf(path), "Give the file of the range scan");
  }
}

// Ends the command as the step did that stopped it.
void TellStop(const Stop& stop, const Command::Context& context) {
  std::string remedies;
  for (const std::string& remedy : stop.remedies) remedies += "\n  " + remedy;
  const std::string finding = "stopped at the step " + stop.step + ": " + stop.reason;
  if (stop.exit_code == kExitUntrusted) {
    context.report.SetUntrusted(finding + remedies);
  } else if (stop.exit_code == kExitUsage) {
    throw UsageError(finding + remedies);
  } else if (stop.exit_code == kExitInternalError) {
    throw std::runtime_error(finding + remedies);
  } else {
    throw InputError(stop.step, "", AsClause(stop.reason), remedies);
  }
}

// Of the largest process of this run.
int64_t PeakMemoryWithPrograms() {
  int64_t kilobytes = 0;
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    kilobytes = std::max<int64_t>(kilobytes, usage.ru_maxrss);
  }
  return kilobytes * 1024;
}

void WriteReport(Chain* chain, const RunResult& result, const Command::Context& context) {
  context.progress.Stage("report");
  Json keys = MakeReportKeys(chain, result);
  WriteReportPage(chain, &keys);
  for (const auto& [key, value] : keys.items()) context.report[key] = value;
  const Json& verdict = keys["verdict"];
  if (!result.stop.stopped && verdict["state"] != "trusted") {
    context.report.SetUnfinished(verdict["headline"].get<std::string>() + ".");
  }
  // The report's own figure is of this program, which only waits for those of the steps.
  context.report["peak_memory_bytes"] = PeakMemoryWithPrograms();
  context.report.AddCopyOfAnyEnd(chain->At("report.json"));
  AnswerAtAnyEnd(verdict["headline"].get<std::string>() + "\n" + chain->At("report.html") + "\n");
}

void RunAll(AutoOptions options, const Command::Context& context) {
  options.num_threads = context.options.num_threads;
  options.random_seed = context.options.random_seed;
  while (options.output_path.size() > 1 && options.output_path.back() == '/') {
    options.output_path.pop_back();
  }
  ThrowIfProblems(options.Problems());
  CheckInputs(options);
  const SignalGuard signals;
  Chain chain(options);
  RequireInputsApart(&chain);
  CheckPassedOptions(&chain);
  if (options.dry_run) {
    PrintSteps(&chain);
    return;
  }
  MakeFolder(options.output_path);
  MakeFolder(options.output_path + "/log");
  const FolderLock lock(options.output_path);
  TidyUp(options.output_path);
  if (const std::string note = NoteOnOtherPhotos(options.image_path); !note.empty()) {
    context.Warn(note);
  }
  const RunResult result = RunSteps(&chain, context);
  WriteReport(&chain, result, context);
  if (result.stop.stopped) TellStop(result.stop, context);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  AutoOptions options;
  Command command(
      "roomtex-auto",
      "From photos and a range scan to the coloured scan and a report of it, step by step; what is "
      "done already is not done again.",
      "roomtex-auto --image_path photos --scan_path room.e57 --output_path result");
  AddOptions(&options, &command);
  return command.Run(argc, argv, [&](const Command::Context& context) {
    try {
      RunAll(options, context);
    } catch (const Interrupted& interrupted) {
      std::fprintf(stderr, "\nroomtex-auto: stopped; started again, it goes on from here\n");
      DieBySignal(interrupted.signal);  // everything on the way is tidied up by now
    }
  });
}
