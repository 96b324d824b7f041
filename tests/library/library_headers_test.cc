// Every installed header compiles alone, without precompiled headers, with nothing but what is
// installed. Label `slow`: a minute or two of parsing Eigen.

#include <gtest/gtest.h>

#include "tests/library/installed_library.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

TEST(Library, EveryInstalledHeaderCompilesAlone) {
  const TempFolder folder;
  const CommandResult installed = InstallLibraries(folder / "prefix");
  ASSERT_EQ(installed.exit_code, 0) << installed.err;
  const CommandResult built =
      BuildProject("tests/library/headers", folder / "prefix", folder / "build");
  EXPECT_EQ(built.exit_code, 0) << built.out << built.err;
}

}  // namespace
}  // namespace roomtex
