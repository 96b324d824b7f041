#pragma once
// Outputs are written aside and renamed, so that a killed run leaves the old file or the new one,
// whole.

#include <fstream>
#include <string>

namespace roomtex {

// A file being written. Writes go to a file beside `path`; Commit() renames it to `path`; without
// Commit() the file beside is removed and `path` is untouched. A link is replaced, not followed.
// What is no regular file (/dev/stdout, a pipe) is written to directly.
class OutputFile {
 public:
  // Throws InputError (path, what hinders, remedy) if the file cannot be written; makes no folders.
  explicit OutputFile(const std::string& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  // Binary stream to the file beside. Writers that want a path take partial_path(), which has the
  // same extension.
  std::ostream& stream();
  const std::string& partial_path() const { return partial_path_; }

  // Flushes, checks and renames. Throws InputError when the disk is full.
  void Commit();

 private:
  std::string path_, target_, partial_path_;
  bool direct_ = false;
  std::ofstream stream_;
};

// Makes the folder and its parents. Throws InputError if that is not possible or a file is in the
// way.
void MakeFolder(const std::string& path);

// folder/name, the folders to it made. name may hold folders, but must not lead out of `folder`
// (names come from models): throws InputError.
std::string PathInside(const std::string& folder, const std::string& name);

// Throws InputError with `remedy` unless the path is that of a regular, readable file.
void RequireFile(const std::string& path, const std::string& remedy);
// The same for a folder.
void RequireFolder(const std::string& path, const std::string& remedy);

}  // namespace roomtex
