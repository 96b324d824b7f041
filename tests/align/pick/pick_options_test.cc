#include <gtest/gtest.h>

#include "align/clicks/photo_model.h"
#include "core/local_server.h"
#include "importers/scan_reader.h"
#include "tests/support/option_check.h"

namespace roomtex {
namespace {

TEST(PickCommandOptions, AreListedAndChecked) {
  ScanReaderOptions reader;
  PhotoCameraOptions camera;
  LocalServerOptions server;
  ExpectChecksItsOptions(
      "roomtex-pick",
      "--input_path none --image_path none --scan_path none --output_path none/none",
      {FieldsOf(&reader), FieldsOf(&camera), FieldsOf(&server)});
}

}  // namespace
}  // namespace roomtex
