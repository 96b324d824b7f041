#include <gtest/gtest.h>

#include "colmap_ext/initializer.h"
#include "colmap_ext/view_chaining.h"
#include "tests/support/option_check.h"

namespace roomtex {
namespace {

TEST(MapperCommandOptions, AreListedAndChecked) {
  InitOptions init;
  ChainOptions chain;
  ExpectChecksItsOptions("roomtex-mapper",
                         "--database_path none --image_path none --output_path none",
                         {FieldsOf(&init), FieldsOf(&chain)});
}

}  // namespace
}  // namespace roomtex
