#include <gtest/gtest.h>

#include "core/local_server.h"
#include "tests/support/option_check.h"
#include "texture/view/view_folder.h"

namespace roomtex {
namespace {

TEST(ViewCommandOptions, AreListedAndChecked) {
  LocalServerOptions server;
  ViewFolderOptions folder;
  ExpectChecksItsOptions("roomtex-view", "--input_path none",
                         {FieldsOf(&folder), FieldsOf(&server)});
}

}  // namespace
}  // namespace roomtex
