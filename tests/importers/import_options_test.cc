#include <gtest/gtest.h>

#include "core/scan_mesh.h"
#include "importers/las_writer.h"
#include "importers/scan_reader.h"
#include "tests/support/option_check.h"

namespace roomtex {
namespace {

TEST(ImportCommandOptions, AreListedAndChecked) {
  ScanReaderOptions reader;
  ScanMeshOptions mesh;
  LasWriterOptions las;
  ExpectChecksItsOptions("roomtex-import", "--input_path none --output_path none.ply",
                         {FieldsOf(&reader), FieldsOf(&mesh), FieldsOf(&las)});
}

}  // namespace
}  // namespace roomtex
