#include "capture/association/associated_views_links.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <system_error>

#include "core/error.h"
#include "core/output_file.h"
#include "core/output_set.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;

const char* const kFolders[] = {"patterned", "plain"};

constexpr char kListName[] = "links.txt";

// What earlier runs wrote: paths below the folder.
std::set<std::string> ReadList(const fs::path& folder) {
  std::set<std::string> list;
  std::ifstream stream(folder / kListName);
  for (std::string line; std::getline(stream, line);) list.insert(line);
  return list;
}

// Refuses folders that hold something else.
void CheckFolders(const fs::path& folder) {
  const std::set<std::string> ours = ReadList(folder);
  for (const char* name : kFolders) {
    const fs::path path = folder / name;
    const fs::file_status status = fs::symlink_status(path);
    if (!fs::exists(status)) continue;
    if (!fs::is_directory(status)) {
      throw InputError(path.string(), "", "is in the way: it is no folder",
                       "Give another --links_path or move it away");
    }
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path)) {
      if (entry.is_directory() && !entry.is_symlink()) continue;
      const std::string below = entry.path().lexically_relative(folder).generic_string();
      if (ours.count(below) > 0) continue;
      throw InputError(path.string(), "",
                       "holds " + below + ", which roomtex-associate did not write",
                       "Give another --links_path or move it away");
    }
  }
}

void Link(const fs::path& photo, const fs::path& link) {
  fs::create_directories(link.parent_path());
  std::error_code error;
  fs::create_symlink(fs::canonical(photo), link, error);
  if (error) fs::copy_file(photo, link);
}

std::shared_ptr<OutputSet> Make(const std::string& folder, const fs::path& image_path,
                                const std::vector<AssociatedPair>& pairs) {
  auto outputs = std::make_shared<OutputSet>(folder);
  const fs::path aside = outputs->aside();
  std::string list;
  for (const char* name : kFolders) {
    fs::create_directories(aside / name);
    outputs->ReplaceFolder(name);
  }
  for (const AssociatedPair& pair : pairs) {
    if (pair.is_spare) continue;
    const std::string photos[] = {pair.patterned_image, pair.plain_image};
    for (int k = 0; k < 2; ++k) {
      Link(image_path / photos[k], aside / kFolders[k] / pair.patterned_image);
      list += std::string(kFolders[k]) + "/" + pair.patterned_image + "\n";
    }
  }
  OutputFile file(outputs->Path(kListName));
  file.stream() << list;
  file.Commit();
  return outputs;
}

}  // namespace

int NumLinks(const std::vector<AssociatedPair>& pairs) {
  return static_cast<int>(std::count_if(pairs.begin(), pairs.end(),
                                        [](const AssociatedPair& pair) { return !pair.is_spare; }));
}

std::shared_ptr<OutputSet> MakeLinks(const std::string& folder, const std::string& image_path,
                                     const std::vector<AssociatedPair>& pairs) {
  MakeFolder(folder);
  try {
    CheckFolders(folder);
    return Make(folder, image_path, pairs);
  } catch (const fs::filesystem_error& error) {
    throw InputError(folder, "", "cannot be filled: " + error.code().message(),
                     "Check that the folder may be written");
  }
}

}  // namespace roomtex
