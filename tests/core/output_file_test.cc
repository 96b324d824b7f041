#include "core/output_file.h"

#include <csignal>
#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "core/partial_path.h"
#include "core/report.h"
#include "tests/core/failing_calls.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

size_t NumFiles(const std::string& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

TEST(OutputFile, ReplacesTheOldFileAtCommitAndNotBefore) {
  const TempFolder folder;
  const std::string path = folder / "out.ply";
  WriteBytes(path, "old");
  OutputFile file(path);
  file.stream() << "new";
  file.stream().flush();
  EXPECT_EQ(ReadBytes(path), "old");
  EXPECT_EQ(fs::path(file.partial_path()).extension(), ".ply");
  EXPECT_EQ(fs::path(file.partial_path()).parent_path(), folder.path());
  file.Commit();
  EXPECT_EQ(ReadBytes(path), "new");
  EXPECT_EQ(NumFiles(folder.path()), 1u);
}

TEST(OutputFile, WithoutCommitTheOldFileStaysAndNothingIsLeft) {
  const TempFolder folder;
  const std::string path = folder / "out.ply";
  WriteBytes(path, "old");
  try {
    OutputFile file(path);
    file.stream() << "half of the n";
    throw std::runtime_error("on the way");
  } catch (const std::runtime_error&) {
  }
  EXPECT_EQ(ReadBytes(path), "old");
  EXPECT_EQ(NumFiles(folder.path()), 1u);
}

TEST(OutputFile, KilledWriterLeavesTheOldFile) {
  const TempFolder folder;
  const std::string path = folder / "out.ply";
  WriteBytes(path, "old");
  const pid_t child = fork();
  if (child == 0) {
    OutputFile file(path);
    file.stream() << std::string(1 << 20, 'x');
    raise(SIGKILL);
    file.Commit();
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(ReadBytes(path), "old");
}

TEST(OutputFile, ItsNameIsOnTheDiskOnceItIsThere) {
  const TempFolder folder;
  const std::string path = folder / "out.ply";
  std::string synced;
  FailingCalls calls;
  calls.on_fsync = [&](const std::string& file) {
    if (fs::exists(path)) synced = file;
    return 0;
  };
  OutputFile file(path);
  file.Commit();
  EXPECT_EQ(synced, fs::canonical(folder.path()));
}

TEST(OutputFile, MayBeWrittenThroughItsPath) {
  const TempFolder folder;
  OutputFile file(folder / "image.png");
  WriteBytes(file.partial_path(), "written by another library");
  file.Commit();
  EXPECT_EQ(ReadBytes(folder / "image.png"), "written by another library");
}

TEST(OutputFile, TwoOfOneNameWithDifferentExtensionsDoNotMeet) {
  const TempFolder folder;
  OutputFile ply(folder / "model.ply"), glb(folder / "model.glb");
  ply.stream() << "ply";
  glb.stream() << "glb";
  ply.Commit();
  glb.Commit();
  EXPECT_EQ(ReadBytes(folder / "model.ply"), "ply");
  EXPECT_EQ(ReadBytes(folder / "model.glb"), "glb");
}

TEST(OutputFile, ReplacesALinkAndNotWhatItLeadsTo) {
  const TempFolder folder;
  WriteBytes(folder / "target", "old");
  fs::create_symlink(folder / "target", folder / "link");
  OutputFile file(folder / "link");
  file.stream() << "new";
  file.Commit();
  EXPECT_FALSE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(ReadBytes(folder / "link"), "new");
  EXPECT_EQ(ReadBytes(folder / "target"), "old");
}

TEST(OutputFile, KeepsTheRightsOfTheOldFile) {
  const TempFolder folder;
  const std::string path = folder / "out.ply";
  WriteBytes(path, "old");
  fs::permissions(path, static_cast<fs::perms>(0640));
  OutputFile file(path);
  file.stream() << "new";
  file.Commit();
  EXPECT_EQ(fs::status(path).permissions(), static_cast<fs::perms>(0640));
  OutputFile fresh(folder / "fresh.ply");
  fresh.Commit();
  const mode_t mask = umask(0);
  umask(mask);
  EXPECT_EQ(fs::status(folder / "fresh.ply").permissions(), static_cast<fs::perms>(0666 & ~mask));
}

TEST(OutputFile, TakesTheLongestNameThereIs) {
  const TempFolder folder;
  for (const std::string& name : {std::string(251, 'n') + ".ply", "n." + std::string(253, 'e')}) {
    OutputFile file(folder / name);
    file.stream() << "x";
    file.Commit();
    EXPECT_EQ(ReadBytes(folder / name), "x");
  }
}

TEST(OutputFile, NamesNobodyCanForesee) {
  const TempFolder folder;
  const OutputFile one(folder / "a"), other(folder / "a");
  EXPECT_NE(one.partial_path(), other.partial_path());
}

TEST(OutputFile, RemovesWhatAKilledWriterLeftAndNothingOfTheLiving) {
  const TempFolder folder;
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  std::string left;
  const auto write_half = [&](bool dies) {
    const pid_t child = fork();
    if (child == 0) {
      OutputFile file(folder / "out.ply");
      const std::string partial = file.partial_path();
      (void)!write(ends[1], partial.c_str(), partial.size());
      if (dies) raise(SIGKILL);
      pause();
    }
    left.resize(4096);
    left.resize(static_cast<size_t>(read(ends[0], left.data(), left.size())));
    return child;
  };
  int status = 0;
  waitpid(write_half(true), &status, 0);
  const std::string dead = left;
  ASSERT_TRUE(fs::exists(dead));
  const pid_t living = write_half(false);
  EXPECT_FALSE(fs::exists(dead));
  RemoveLeftovers(folder.path());
  EXPECT_TRUE(fs::exists(left));
  kill(living, SIGKILL);
  waitpid(living, &status, 0);
  RemoveLeftovers(folder.path());
  EXPECT_EQ(NumFiles(folder.path()), 0u);
}

TEST(OutputFile, PipeThatNobodyReadsIsSaid) {
  const TempFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  OutputFile file(folder / "pipe");
  EXPECT_INPUT_ERROR(file.Commit(), "nobody reads from");
}

TEST(OutputFile, DevicesAndPipesStayWhatTheyAre) {
  const TempFolder folder;
  const std::string pipe = folder / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const pid_t reader = fork();
  if (reader == 0) _exit(ReadBytes(pipe) == "through the pipe" ? 0 : 1);
  {
    OutputFile file(pipe);
    file.stream() << "through the pipe";
    file.Commit();
  }
  int status = 0;
  waitpid(reader, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_TRUE(fs::is_fifo(pipe));
  {
    OutputFile file("/dev/null");
    file.stream() << "nothing";
    file.Commit();
  }
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST(OutputFile, AFolderBelowDevIsADiskAsAnyOther) {
  if (access("/dev/shm", W_OK) != 0) GTEST_SKIP() << "this system has no /dev/shm";
  const std::string path = "/dev/shm/roomtex_output_file_test_" + std::to_string(getpid());
  {
    OutputFile file(path);
    file.stream() << "new";
    file.Commit();
  }
  EXPECT_EQ(ReadBytes(path), "new");
  fs::remove(path);
}

TEST(OutputFile, FullDiskIsSaid) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "this system has no /dev/full";
  OutputFile file("/dev/full");
  file.stream() << std::string(1 << 20, 'x');
  EXPECT_INPUT_ERROR(file.Commit(), "/dev/full: could not be written to its end");
}

TEST(OutputFile, SaysWhatIsInTheWay) {
  const TempFolder folder;
  EXPECT_INPUT_ERROR(OutputFile(folder.path()), "is a folder, expected a file to write");
  EXPECT_INPUT_ERROR(OutputFile(folder / "no/such/folder/out.ply"),
                     "cannot be written (No such file");
  WriteBytes(folder / "file", "x");
  EXPECT_INPUT_ERROR(OutputFile(folder / "file/out.ply"), "cannot be written (Not a directory)");
  EXPECT_EQ(NumFiles(folder.path()), 1u);
}

// As a user without rights, in a process of its own: 0 when `body` throws an InputError.
template <typename Body>
int WithoutRights(const Body& body) {
  const pid_t child = fork();
  if (child == 0) {
    if (geteuid() == 0 && (setgid(65534) != 0 || setuid(65534) != 0)) _exit(3);
    try {
      body();
    } catch (const InputError&) {
      _exit(0);
    } catch (...) {
      _exit(2);
    }
    _exit(1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(OutputFile, UnwritableFoldersAreInputErrors) {
  const TempFolder folder;
  fs::create_directory(folder / "locked");
  WriteBytes(folder / "locked/secret", "x");
  fs::permissions(folder / "locked/secret", fs::perms(0));
  fs::permissions(folder / "locked", fs::perms(0555));
  fs::permissions(folder.path(), fs::perms(0755));
  EXPECT_EQ(WithoutRights([&] { OutputFile(folder / "locked/out.ply"); }), 0);
  EXPECT_EQ(WithoutRights([&] { MakeFolder(folder / "locked/below"); }), 0);
  EXPECT_EQ(WithoutRights([&] { MakeFolder(folder / "locked"); }), 0);
  EXPECT_EQ(WithoutRights([&] { RequireFile(folder / "locked/secret", "Remedy"); }), 0);
  fs::permissions(folder / "locked", fs::perms(0755));
}

TEST(MakeFolder, MakesParentsAndAcceptsWhatIsThere) {
  const TempFolder folder;
  MakeFolder(folder / "a/b/c/");
  EXPECT_TRUE(fs::is_directory(folder / "a/b/c"));
  MakeFolder(folder / "a/b/c");
  WriteBytes(folder / "file", "x");
  EXPECT_INPUT_ERROR(MakeFolder(folder / "file"), "is a file, expected a folder");
  EXPECT_INPUT_ERROR(MakeFolder(folder / "file/below"), "cannot be made a folder");
}

TEST(RequireFileAndFolder, SayWhatIsWrong) {
  const TempFolder folder;
  WriteBytes(folder / "file", "x");
  RequireFile(folder / "file", "");
  RequireFolder(folder.path(), "");
  EXPECT_INPUT_ERROR(RequireFile(folder / "missing", "Do this"),
                     "missing: does not exist. Do this.");
  EXPECT_INPUT_ERROR(RequireFile(folder.path(), "Do this"),
                     "is a folder, expected a file. Do this.");
  EXPECT_INPUT_ERROR(RequireFile("/dev/null", ""), "is not a regular file");
  EXPECT_INPUT_ERROR(RequireFolder(folder / "file", "Do this"), "is a file, expected a folder");
  EXPECT_INPUT_ERROR(RequireFolder(folder / "missing", "Do this"), "does not exist");
}

TEST(WriteJson, NumbersThatAreNotFiniteBecomeNullAndBadTextIsReplaced) {
  const TempFolder folder;
  Json json;
  json["b"] = std::numeric_limits<double>::infinity();
  json["a"] = "caf\xe9";  // Latin-1, no UTF-8
  WriteJson(folder / "report.json", json);
  const Json read = Json::parse(ReadBytes(folder / "report.json"));
  EXPECT_TRUE(read["b"].is_null());
  EXPECT_EQ(read.begin().key(), "b");  // keys keep their order
}

TEST(ErrorMessages, AreOneSentenceEachPart) {
  EXPECT_STREQ(InputError("a.rtpi", LinePosition(12), "is odd", "Make it even").what(),
               "a.rtpi: line 12: is odd. Make it even.");
  EXPECT_STREQ(InputError("a.rtpi", "", "is odd", "").what(), "a.rtpi: is odd.");
  EXPECT_EQ(BytePosition(1ll << 40), "byte 1099511627776");
  ThrowIfProblems({});
  try {
    ThrowIfProblems({"first", "second"});
    ADD_FAILURE();
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.what(), "first\nsecond");
  }
}

}  // namespace
}  // namespace roomtex
