#include <gtest/gtest.h>

#include "core/scan_mesh.h"
#include "importers/scan_reader.h"
#include "tests/support/option_check.h"

namespace roomtex {
namespace {

TEST(ImportCommandOptions, AreListedAndChecked) {
  ScanReaderOptions reader;
  ScanMeshOptions mesh;
  ExpectChecksItsOptions("roomtex-import", "--input_path none --output_path none.ply",
                         {FieldsOf(&reader), FieldsOf(&mesh)});
}

}  // namespace
}  // namespace roomtex
