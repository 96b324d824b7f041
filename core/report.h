#pragma once
// The JSON report that every command writes with --report_path (docs/commands.md).

#include <initializer_list>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/similarity.h"

namespace roomtex {

// Ordered: keys stand in the file as they were set.
using Json = nlohmann::ordered_json;

class Report {
 public:
  // A key of the command's own, e.g. report["num_vertices"] = 12.
  Json& operator[](const std::string& key) { return keys_[key]; }
  const Json& keys() const { return keys_; }
  Json& keys() { return keys_; }

  void AddWarning(const std::string& warning) { warnings_.push_back(warning); }
  // The answer is not to be trusted (exit 4); several reasons are joined.
  void SetUntrusted(const std::string& reason);
  // The report says the same, but the command ends with 0: what was asked for is done, and yet what
  // is there is no whole answer, or one that the user has accepted.
  void SetUnfinished(const std::string& reason);

  // Writes the same JSON to `path` as well, once the command has run to its end (exit 0 or 4).
  void AddCopy(const std::string& path) { copies_.push_back(path); }
  // The same whatever the exit code is.
  void AddCopyOfAnyEnd(const std::string& path) { copies_of_any_end_.push_back(path); }

  bool trusted() const { return reason_.empty(); }
  bool ends_untrusted() const { return ends_untrusted_; }  // with exit 4
  const std::string& reason() const { return reason_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  const std::vector<std::string>& copies() const { return copies_; }
  const std::vector<std::string>& copies_of_any_end() const { return copies_of_any_end_; }

 private:
  Json keys_ = Json::object();
  std::vector<std::string> warnings_, copies_, copies_of_any_end_;
  std::string reason_;
  bool ends_untrusted_ = false;
};

Json NumberOrNull(double value);  // null: not finite
// The number at a path of keys; NaN where there is none.
double NumberAt(const Json& json, std::initializer_list<const char*> keys);
// Vectors as JSON arrays.
Json ToJson(const Eigen::VectorXd& vector);
// {scale, rotation_wxyz, translation}.
Json ToJson(const Similarity& similarity);

// Written aside and renamed; two-space indent. Numbers that are not finite become null.
void WriteJson(const std::string& path, const Json& json);

}  // namespace roomtex
