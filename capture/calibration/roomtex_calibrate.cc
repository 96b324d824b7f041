// roomtex-calibrate: the camera from photos of a board. Parses, calls, reports.

#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>

#include "capture/calibration/board_detection.h"
#include "capture/calibration/board_print.h"
#include "capture/calibration/calibration.h"
#include "capture/calibration/calibration_database.h"
#include "capture/calibration/calibration_output.h"
#include "capture/calibration/calibration_picture.h"
#include "core/camera_text.h"
#include "core/command_line.h"
#include "core/commit_together.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/photo_files.h"
#include "core/picture_file.h"
#include "core/standard_files.h"

namespace roomtex {
namespace {

struct Arguments {
  std::string image_path, output_path, board_path, coverage_path, database_path,
      database_output_path;
  BoardOptions board;
  CalibrationOptions calibration;
};

void AddOptions(Arguments* a, Command* command) {
  command->AddInputPath("image_path", &a->image_path,
                        "Folder with photos of the board, taken with the focus and zoom of the "
                        "capture; used as they are stored (an EXIF orientation is ignored, as "
                        "COLMAP ignores it).",
                        Command::Kind::kOptional);
  command->Add(FieldsOf(&a->board));
  command->AddOutputPath("output_path", &a->output_path, "The camera, as COLMAP's cameras.txt.",
                         Command::Kind::kOptional);
  command->AddOutputPath("board_path", &a->board_path,
                         "Write the board as a PDF to print, in its true size; without "
                         "--image_path that is all.",
                         Command::Kind::kOptional);
  command->AddOutputPath("coverage_path", &a->coverage_path,
                         "Picture (PNG or JPEG) of where the corners lie, with the residuals and "
                         "the photos left out.",
                         Command::Kind::kOptional);
  const OptionFields calibration = FieldsOf(&a->calibration);
  command->Add(calibration.Only({"camera_model"}));
  command->AddInputPath("apply", &a->database_path,
                        "COLMAP's database; --apply_output gets a copy of it with this camera (the "
                        "database itself is not changed).",
                        Command::Kind::kOptional);
  command->AddOutputPath("apply_output", &a->database_output_path,
                         "The copy; default: beside the database, NAME_calibrated.db, which is not "
                         "replaced where photos, features or pairs were made in it.",
                         Command::Kind::kOptional);
  command->Add(calibration.Without({"camera_model"}));
}

void CheckArguments(Arguments* a) {
  std::vector<std::string> problems = a->board.Problems();
  AppendProblems(a->calibration.Problems(), &problems);
  const bool only_board = !a->board_path.empty() && a->image_path.empty();
  if (!only_board && a->image_path.empty()) {
    problems.push_back(
        "--image_path is required: the photos of the board (to print a board first, "
        "give --board_path board.pdf)");
  }
  if (!only_board && a->output_path.empty()) problems.push_back("--output_path is required");
  if (a->database_path.empty() && !a->database_output_path.empty()) {
    problems.push_back("--apply_output needs --apply, the database to copy");
  }
  if (!a->coverage_path.empty() && !cv::haveImageWriter(a->coverage_path)) {
    problems.push_back("--coverage_path is \"" + a->coverage_path +
                       "\", expected a name that ends with .png or .jpg");
  }
  ThrowIfProblems(problems);
  if (a->database_path.empty()) return;
  RequireFile(a->database_path, "Check --apply: it is COLMAP's database.db");
  const std::filesystem::path database(a->database_path);
  if (a->database_output_path.empty()) {
    a->database_output_path =
        (database.parent_path() / (database.stem().string() + "_calibrated.db")).string();
    RequireNothingNew(a->database_output_path, a->database_path);
  }
  RequireNoLog(a->database_output_path);
}

void Apply(const Arguments& a, const Camera& camera, const Command::Context& context) {
  if (a.database_path.empty()) return;
  context.progress.Stage("apply");
  const AppliedCameras applied = ApplyToDatabase(camera, a.database_path, a.database_output_path);
  for (const std::string& note : applied.notes) context.Warn(note);
  const size_t count = applied.same_size.size() + applied.scaled.size();
  context.progress.Note(std::to_string(count) + " cameras of " + a.database_path +
                        " calibrated in " + a.database_output_path);
  if (applied.has_pairs) {
    context.Warn(
        "pairs of photos in the database were verified with the cameras as they were; if their "
        "focal "
        "length was far off, extract and match anew with the printed options instead");
  }
  Json& json = context.report["applied"];
  json["output"] = a.database_output_path;
  json["same_size"] = applied.same_size;
  json["scaled"] = applied.scaled;
  json["left"] = applied.left;
}

void Run(Arguments* a, const Command::Context& context) {
  CheckArguments(a);
  // An output that cannot be written is better known before.
  for (const std::string& path : {a->output_path, a->coverage_path, a->database_output_path}) {
    if (!path.empty()) OutputFile probe(path);
  }
  // Photos side by side, each on one thread: OpenCV's own threads would come on top.
  cv::setNumThreads(1);
  const Board board = MakeBoard(a->board);
  if (!a->board_path.empty()) WriteBoardPdf(board, a->board_path);
  if (a->image_path.empty()) {
    AnswerAtEnd(a->board_path + "\n");
    return;
  }
  const std::vector<std::string> names =
      ListPhotoFiles(a->image_path, "Give the folder with photos of the board");
  if (const std::string note = NoteOnOtherPhotos(a->image_path); !note.empty()) context.Warn(note);
  context.progress.Stage("find boards", static_cast<int>(names.size()));
  const std::vector<BoardPhoto> photos =
      FindBoards(a->image_path, names, board, context.options.num_threads, &context.progress);
  context.progress.Stage("calibrate");
  const Calibration calibration = Calibrate(photos, board, a->calibration, a->image_path);
  FillReport(calibration, board, &context.report);
  for (const std::string& warning : calibration.warnings) context.Warn(warning);
  std::string reasons;
  for (const std::string& reason : calibration.reasons) {
    reasons += (reasons.empty() ? "" : "; ") + reason;
  }
  if (!reasons.empty()) context.report.SetUntrusted(reasons);
  context.progress.Note(calibration.why_model);

  context.progress.Stage("write");
  CommitFilesAtEnd();
  WriteCamerasText(a->output_path, calibration.camera);
  if (!a->coverage_path.empty()) WritePictureFile(a->coverage_path, DrawCalibration(calibration));
  Apply(*a, calibration.camera, context);
  context.progress.Note(FocalLengthLine(calibration));
  AnswerAtEnd(FeatureExtractorOptions(calibration.camera, kLensDigits) + "\n");
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  roomtex::Arguments arguments;
  roomtex::Command command(
      "roomtex-calibrate",
      "Calibrates a camera by photos of a board, for COLMAP: cameras.txt, and on stdout the "
      "options "
      "for colmap feature_extractor.",
      "roomtex-calibrate --image_path boards --board 9x6 --square 0.025 --output_path camera.txt");
  roomtex::AddOptions(&arguments, &command);
  return command.Run(argc, argv, [&arguments](const roomtex::Command::Context& context) {
    roomtex::Run(&arguments, context);
  });
}
