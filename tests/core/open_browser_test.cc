#include "core/open_browser.h"

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::Not;

// An xdg-open of ours that notes what it was called with.
class FakeBrowser {
 public:
  FakeBrowser() {
    const char* path = std::getenv("PATH");
    old_path_ = path == nullptr ? "" : path;
    std::ofstream(folder_ / "xdg-open")
        << "#!/bin/sh\nstat -c %a \"$1\" > " << folder_ / "mode"
        << "\ncat \"$1\" > " << folder_ / "page"
        << "\necho \"$1\" > " << folder_ / "part\nmv " << folder_ / "part"
        << " " << folder_ / "called\n";
    std::filesystem::permissions(folder_ / "xdg-open", std::filesystem::perms::owner_all);
    setenv("PATH", (folder_ / "" + ":" + old_path_).c_str(), 1);
  }
  ~FakeBrowser() { setenv("PATH", old_path_.c_str(), 1); }

  // What it wrote, once it was called; "" after ten seconds.
  std::string Read(const std::string& name) const {
    for (int i = 0; i < 1000 && !std::filesystem::exists(folder_ / "called"); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return std::filesystem::exists(folder_ / name) ? ReadBytes(folder_ / name) : "";
  }

 private:
  TempFolder folder_;
  std::string old_path_;
};

TEST(OpenBrowser, TellsTheAddressInAFileThatOnlyTheUserReads) {
  const FakeBrowser browser;
  std::string page;
  {
    const OpenBrowser open("http://127.0.0.1:8080/secret/?a=1&b=2");
    EXPECT_EQ(open.problem(), "");
    page = browser.Read("called");
    EXPECT_THAT(page, Not(HasSubstr("secret")));  // the process list shows it
    EXPECT_EQ(browser.Read("mode"), "600\n");
    EXPECT_THAT(browser.Read("page"), HasSubstr("http://127.0.0.1:8080/secret/?a=1&#38;b=2"));
    page.erase(page.find_last_not_of('\n') + 1);
    EXPECT_TRUE(std::filesystem::exists(page));
  }
  EXPECT_FALSE(std::filesystem::exists(page));
}

TEST(OpenBrowser, SaysThatThereIsNone) {
  const std::string path = std::getenv("PATH");
  const TempFolder empty;
  setenv("PATH", (empty / "").c_str(), 1);
  const OpenBrowser open("http://127.0.0.1:8080/secret/");
  setenv("PATH", path.c_str(), 1);
  EXPECT_THAT(open.problem(), HasSubstr("by hand"));
}

}  // namespace
}  // namespace roomtex
