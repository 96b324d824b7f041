// roomtex-align: the sparse model into the scan, by picks or without.

#include "align/command/align_model.h"
#include "align/command/align_options.h"
#include "align/command/align_photos.h"
#include "core/command_line.h"

int main(int argc, char** argv) {
  roomtex::AlignCommandOptions arguments;
  roomtex::Command command(
      "roomtex-align",
      "Brings COLMAP's sparse model into the frame of a range scan, by picks or without.",
      "roomtex-align --input_path sparse/0 --scan_path room.rtpi --picks_path picks.csv "
      "--output_path aligned");
  roomtex::AddOptions(&arguments, &command);
  return command.Run(argc, argv, [&arguments](const roomtex::Command::Context& context) {
    roomtex::CheckOptions(&arguments);
    if (!arguments.input_path.empty()) {
      roomtex::AlignModel(arguments, context);
    } else if (!arguments.picks_path.empty()) {
      roomtex::AlignPickedPhotos(arguments, context);
    } else {
      roomtex::AlignFoundPhotosAlone(arguments, context);
    }
  });
}
