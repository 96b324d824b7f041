#pragma once
// What roomtex-view serves, as a folder to give away.

#include <string>
#include <vector>

#include "core/progress.h"
#include "texture/view/view_answers.h"

namespace roomtex {

class OptionFields;

struct ViewFolderOptions {
  int photo_size = 2048;  // pixels of the longer side

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

struct ViewFolderSize {
  size_t num_files = 0, num_bytes = 0;
};

// Writes index.html and what belongs to it into `folder`, which exists. Every question of the page
// (ViewAnswers) is answered by a script in data/, since a page that was opened from a disk
// (file://) may read scripts and nothing else: data/WORD.NAME-VALUE.js says
// roomtexGive("WORD.NAME-VALUE", answer), where bytes are base64 with their type behind them.
// data/folder.js says in which sizes there are pictures. Throws InputError as ViewAnswers does, and
// if the disk is full.
ViewFolderSize WriteViewFolder(ViewContent content, const ViewFolderOptions& options,
                               const std::string& folder, int num_threads, Progress* progress);

}  // namespace roomtex
