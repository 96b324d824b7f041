#include <gtest/gtest.h>

#include "core/error.h"
#include "importers/scan_reader.h"
#include "tests/support/option_check.h"
#include "tests/support/run_command.h"
#include "texture/colorize.h"
#include "texture/output/write_glb.h"
#include "texture/output/write_web_glb.h"

namespace roomtex {
namespace {

constexpr char kArguments[] =
    "--input_path none --image_path none --scan_path none --output_path none";

TEST(TextureCommandOptions, AreListedAndChecked) {
  ColorizeOptions o;
  GlbOptions glb;
  WebOptions web;
  ScanReaderOptions reader;
  ExpectChecksItsOptions(
      "roomtex-texture", kArguments,
      {FieldsOf(&reader), FieldsOf(&o), FieldsOf(&o.atlas), FieldsOf(&glb), FieldsOf(&web),
       FieldsOf(&o.exposure), FieldsOf(&o.registration), FieldsOf(&o.occlusion), FieldsOf(&o.blend),
       FieldsOf(&o.detail), FieldsOf(&o.surface), FieldsOf(&o.mesh)});
}

TEST(TextureCommandOptions, ScaleIsANumberOrAuto) {
  const std::string line = std::string("roomtex-texture ") + kArguments + " --Texture.scale ";
  for (const char* text : {"nonsense", "1.5", "\"\""}) {
    EXPECT_EQ(RunCommandLine(line + text).exit_code, kExitUsage) << text;
  }
  for (const char* text : {"auto", "0", "16"}) {
    EXPECT_EQ(RunCommandLine(line + text).exit_code, kExitInput) << text;
  }
}

}  // namespace
}  // namespace roomtex
