#include <gtest/gtest.h>

#include "align/alignment.h"
#include "align/clicks/photo_model.h"
#include "importers/scan_reader.h"
#include "tests/support/option_check.h"

namespace roomtex {
namespace {

TEST(AlignCommandOptions, AreListedAndChecked) {
  AlignmentOptions o;
  ScanPlaneOptions planes;
  ScanReaderOptions reader;
  PhotoCameraOptions camera;
  ExpectChecksItsOptions(
      "roomtex-align", "--input_path none --scan_path none --picks_path none --output_path none",
      {FieldsOf(&reader), FieldsOf(&camera), FieldsOf(&o.bundle), FieldsOf(&planes),
       FieldsOf(&o.picks), FieldsOf(&o.scale), FieldsOf(&o.trust), FieldsOf(&o.surface),
       FieldsOf(&o.fit), FieldsOf(&o.mesh)});
}

}  // namespace
}  // namespace roomtex
