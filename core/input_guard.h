#pragma once
// Inputs are never changed: what a command reads, no output of it replaces. Command::Run tells the
// guard the paths of all options that were declared as input or output; readers tell what they read
// below them; OutputFile and OutputSet ask before they write. There is one guard per process, empty
// outside of Command::Run.

#include <string>
#include <utility>
#include <vector>

namespace roomtex {

struct GuardedPaths {
  using OptionPath = std::pair<std::string, std::string>;  // "scan_path", "room.e57"
  std::vector<OptionPath> inputs, outputs;
};

// The file of a path: "file.e57#name" is a scan of file.e57. Names of files and of scans may have a
// # of their own: the first one before which there is a file parts the two. The path itself where
// it is a file, or nothing is there. (The rule of SplitScanPath, importers/scan_path.h.)
std::string FileOf(const std::string& path);

class InputGuard {
 public:
  // Throws UsageError, naming both options, if an output is an input or another output, whatever
  // the paths look like (links, "..", upper folders), or a photo or model file in a folder of
  // inputs.
  explicit InputGuard(GuardedPaths paths);
  ~InputGuard();
  InputGuard(const InputGuard&) = delete;
  InputGuard& operator=(const InputGuard&) = delete;
};

// Throws UsageError if --output_path is the folder of the photos or lies below it: COLMAP, which
// looks for photos in all of its folders, would take pictures that are written there for some.
// Photos that are not there, "" among them, are for others to say.
void RequireOutsidePhotos(const std::string& output_path, const std::string& photos);

// This file is read as an input: one below a path of an input option.
void NoteInput(const std::string& path);
// The same for a file that no option names, e.g. the scan that an aligned model remembers.
void NoteInput(const std::string& path, const std::string& named_by);

// Throws UsageError if a file of this path would replace an input.
void RefuseToReplaceInput(const std::string& path);

// The same, and InputError if this is a folder or a file that may not be written over.
void RequireReplaceable(const std::string& path);

// What has been written to its place so far, in order.
void NoteOutput(const std::string& path);
std::vector<std::string> OutputsSoFar();

// A log that is written while the command runs, and stays whatever becomes of it.
void NoteLog(const std::string& path);
std::vector<std::string> LogsSoFar();

}  // namespace roomtex
