#pragma once
// Brings to the disk what must be there before the next step, so that a power cut leaves what a
// kill leaves. A file system that has no such call counts as one that does so anyway; a full or
// broken disk throws std::system_error.

#include <string>
#include <vector>

namespace roomtex {

// The names in a folder: after a rename.
void SyncFolder(const std::string& folder);
// Those in it and in all folders below it.
void SyncFoldersBelow(const std::string& folder);
// The bytes of folder/file of each.
void SyncFiles(const std::string& folder, const std::vector<std::string>& files);

}  // namespace roomtex
