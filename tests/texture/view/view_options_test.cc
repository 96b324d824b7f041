#include <gtest/gtest.h>

#include "core/local_server.h"
#include "tests/support/option_check.h"

namespace roomtex {
namespace {

TEST(ViewCommandOptions, AreListedAndChecked) {
  LocalServerOptions server;
  ExpectChecksItsOptions("roomtex-view", "--input_path none", {FieldsOf(&server)});
}

}  // namespace
}  // namespace roomtex
