#include "core/progress.h"

#include <gmock/gmock.h>

#include "core/parallel.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

// What a progress prints on an stderr that is no terminal.
template <typename Body>
std::string Printed(bool quiet, const Body& body) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  {
    Progress progress(quiet);
    body(&progress);
  }
  EXPECT_THAT(testing::internal::GetCapturedStdout(), IsEmpty());
  return testing::internal::GetCapturedStderr();
}

TEST(Progress, PrintsALinePerStageWithoutATerminal) {
  const std::string text = Printed(false, [](Progress* progress) {
    progress->Stage("read scan", 3);
    for (int i = 0; i < 5; ++i) progress->Tick();  // more than promised
    progress->Note("a note");
    progress->Stage("write");
    progress->Warning("a warning");
  });
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 4);
  EXPECT_EQ(text.find('\r'), std::string::npos);
  EXPECT_LT(text.find("read scan"), text.find("write  "));
  EXPECT_THAT(text, HasSubstr("  a note\n"));
  EXPECT_THAT(text, HasSubstr("warning: a warning\n"));
}

TEST(Progress, QuietPrintsNothingButMeasures) {
  EXPECT_THAT(Printed(true,
                      [](Progress* progress) {
                        progress->Stage("first");
                        progress->Tick();
                        progress->Warning("a warning");
                        progress->Stage("second");
                        progress->Finish();
                        progress->Finish();
                        EXPECT_THAT(progress->stage_seconds(),
                                    ElementsAre(Pair("first", testing::Ge(0.0)),
                                                Pair("second", testing::Ge(0.0))));
                      }),
              IsEmpty());
}

TEST(Progress, TicksFromManyThreads) {
  Printed(false, [](Progress* progress) {
    progress->Stage("work", 1000);
    ParallelFor(4, 0, 1000, [&](int) { progress->Tick(); });
    progress->Finish();
    EXPECT_EQ(progress->stage_seconds().size(), 1u);
  });
}

}  // namespace
}  // namespace roomtex
