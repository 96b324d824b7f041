#include <gtest/gtest.h>

#include "capture/association/associated_views.h"
#include "capture/calibration/calibration.h"
#include "capture/pattern/pattern.h"
#include "capture/simulation/simulated_room.h"
#include "tests/support/option_check.h"

namespace roomtex {
namespace {

TEST(SimulateCommandOptions, AreListedAndChecked) {
  SimulatedRoomOptions room;
  ExpectChecksItsOptions("roomtex-simulate", "--output_path none", {FieldsOf(&room)});
}

TEST(PatternCommandOptions, AreListedAndChecked) {
  PatternOptions pattern;
  ExpectChecksItsOptions("roomtex-pattern", "--output_path none.png", {FieldsOf(&pattern)});
}

TEST(AssociateCommandOptions, AreListedAndChecked) {
  AssociateOptions options;
  ExpectChecksItsOptions("roomtex-associate", "--image_path none --output_path none",
                         {FieldsOf(&options)});
}

TEST(CalibrateCommandOptions, AreListedAndChecked) {
  BoardOptions board;
  board.size = "9x6";
  CalibrationOptions calibration;
  ExpectChecksItsOptions("roomtex-calibrate",
                         "--image_path none --output_path none --board " + board.size,
                         {FieldsOf(&board), FieldsOf(&calibration)});
}

}  // namespace
}  // namespace roomtex
