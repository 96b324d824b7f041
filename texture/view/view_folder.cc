#include "texture/view/view_folder.h"

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/command_line.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/parallel.h"
#include "core/text.h"
#include "view_page.h"

namespace roomtex {
namespace {

constexpr int kPreviewTexture = 1024, kWholeTexture = 4096;  // of the page's room.js
constexpr int kThumbnail = 256;                              // cameras.js
constexpr int kPinholePhoto = 1536;                          // lumigraph.js

const char kReadme[] =
    "A room to look at: open index.html in a browser. Everything is in this folder, nothing is\n"
    "fetched from the internet. On a web server any address of the folder does.\n"
    "Made with roomtex-view.\n";

// A question of the page: a word, and values in the order in which the page says them.
struct Question {
  std::string word;
  std::vector<std::pair<std::string, int>> values;

  std::string Name() const {
    std::string name = word;
    for (const auto& [key, value] : values) name += "." + key + "-" + std::to_string(value);
    return name;
  }
};

// A script of the answer; "" = there is none.
std::string ScriptOf(const ViewAnswers& answers, const Question& question) {
  ViewAnswers::Query query;
  for (const auto& [key, value] : question.values) query[key] = std::to_string(value);
  const std::string begin = "roomtexGive(\"" + question.Name() + "\",";
  const auto json = answers.json().find(question.word);
  if (json != answers.json().end()) {
    Json answer = json->second(query);
    if (question.word == "scene") answer["path"] = answer["name"];  // nobody else's business
    // A name may be in whatever encoding the disk has.
    return begin + answer.dump(-1, ' ', false, Json::error_handler_t::replace) + ");\n";
  }
  const auto content = answers.content().at(question.word)(query);
  if (!content) return "";
  return begin + "\"" + Base64(content->bytes->data(), content->bytes->size()) + "\",\"" +
         content->type + "\");\n";
}

std::vector<Question> QuestionsOf(const ViewAnswers& answers, int photo_size) {
  const auto ask = [&answers](const char* word) { return answers.json().at(word)({}); };
  const Json scene = ask("scene"), evidence = ask("evidence"), cameras = ask("cameras"),
             lumigraph = ask("lumigraph");
  std::vector<Question> questions = {
      {"scene", {}}, {"evidence", {}}, {"cameras", {}}, {"lumigraph", {}}, {"points", {}}};
  const bool has_evidence = evidence["available"];
  for (const Json& chunk : scene["chunks"]) {
    const int id = chunk["id"];
    for (const int level : {0, 1, 2}) {
      questions.push_back({"chunk", {{"id", id}, {"level", level}}});
      if (has_evidence) questions.push_back({"evidence_chunk", {{"id", id}, {"level", level}}});
    }
  }
  for (const Json& page : scene["pages"]) {
    const int id = page["id"];
    questions.push_back({"texture", {{"page", id}, {"max", kPreviewTexture}}});
    const int width = page["width"], height = page["height"];
    if (std::max(width, height) > kPreviewTexture) {
      questions.push_back({"texture", {{"page", id}, {"max", kWholeTexture}}});
    }
  }
  for (const Json& camera : cameras) {
    const int id = camera["id"];
    questions.push_back({"lattice", {{"id", id}}});
    if (camera["photo"] != true) continue;
    questions.push_back({"photo", {{"id", id}, {"max", kThumbnail}}});
    questions.push_back({"photo", {{"id", id}, {"max", photo_size}}});
  }
  for (const Json& photo : lumigraph["photos"]) {
    const int id = photo["id"];
    questions.push_back({"pinhole_photo", {{"id", id}, {"max", kPinholePhoto}}});
    questions.push_back({"depths", {{"id", id}}});
  }
  return questions;
}

// The page, with the script that makes it look into data/ before its own.
std::string FolderPage(std::string html) {
  const std::string own = "<script defer src=\"view.js\">";
  const size_t at = html.find(own);
  if (at == std::string::npos) throw std::logic_error("index.html lacks the script of the page");
  return html.insert(at, "<script src=\"data/folder.js\"></script>\n");
}

}  // namespace

void ViewFolderOptions::Declare(OptionFields* fields) {
  fields
      ->Int("photo_size", &photo_size,
            "With --output_path: longer side of the photos in the folder, pixels.")
      .Within(256, 8192, "pixels");
}
std::vector<std::string> ViewFolderOptions::Problems() const { return ProblemsOf(*this); }

ViewFolderSize WriteViewFolder(ViewContent content, const ViewFolderOptions& options,
                               const std::string& folder, int num_threads, Progress* progress) {
  progress->Stage("prepare");
  const ViewAnswers answers(std::move(content), num_threads, [] { return false; });
  const std::vector<Question> questions = QuestionsOf(answers, options.photo_size);
  std::atomic<size_t> num_files{0}, num_bytes{0};
  const auto write = [&](const std::string& name, std::string_view bytes) {
    OutputFile file(folder + "/" + name);
    file.stream().write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.Commit();
    ++num_files;
    num_bytes += bytes.size();
  };
  MakeFolder(folder + "/data");
  progress->Stage("write folder", static_cast<int>(questions.size()));
  ParallelFor(num_threads, 0, static_cast<int>(questions.size()), [&](int i) {
    const std::string script = ScriptOf(answers, questions[i]);
    if (!script.empty()) write("data/" + questions[i].Name() + ".js", script);
    progress->Tick();
  });
  const Json sizes = {{"photo", {kThumbnail, options.photo_size}},
                      {"texture", {kPreviewTexture, kWholeTexture}},
                      {"pinhole_photo", {kPinholePhoto}}};
  write("data/folder.js", "var roomtexFolder = {sizes: " + sizes.dump() +
                              ", waiting: new Map()};\n"
                              "function roomtexGive(name, value, type) {\n"
                              "  roomtexFolder.waiting.get(name)?.(value, type);\n}\n");
  std::set<std::string> entries = {"README.txt", "data", "report.json"};
  for (const PageFile& file : kViewPage) {
    const std::string name(file.name);
    entries.insert(name.substr(0, name.find('/')));
    write(name, name == "index.html" ? FolderPage(std::string(file.bytes)) : file.bytes);
  }
  write("README.txt", kReadme);
  // By this the folder is known as ours when it is written again (OutputSet::ReplaceAllOf).
  const Json report = {{"command", "roomtex-view"}, {"version", Version()}, {"entries", entries}};
  write("report.json", report.dump(2) + "\n");
  return {num_files, num_bytes};
}

}  // namespace roomtex
