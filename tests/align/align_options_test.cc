#include <filesystem>

#include <gmock/gmock.h>

#include "align/alignment.h"
#include "align/clicks/photo_model.h"
#include "importers/scan_reader.h"
#include "tests/align/case_folder.h"
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

// Before anything is read: the scan is none.
TEST(AlignCommandOptions, OutputsThatCannotBeWrittenAreToldAtTheStart) {
  CaseFolder files(MakeCase());
  WriteBytes(files.scan_path, "nothing");
  const auto refuses = [&files](const std::string& text, const std::string& more) {
    const CommandResult result = files.Align(more);
    EXPECT_EQ(result.exit_code, 3) << result.err;
    EXPECT_THAT(result.err, testing::HasSubstr(text));
  };
  files.output_path = "/proc/self/fdinfo";  // also for the superuser
  refuses("/proc/self/fdinfo: cannot be written into", "");
  files.output_path = "/proc/self/fdinfo/aligned";
  refuses("/proc/self/fdinfo/aligned: cannot be made a folder", "");
  files.output_path = files.folder / "new/aligned";
  refuses("missing/planes.ply", "--Plane.output_path " + files.folder / "missing/planes.ply");
  refuses("room.rtpi", "");
  EXPECT_FALSE(std::filesystem::exists(files.folder / "new"));
}

}  // namespace
}  // namespace roomtex
