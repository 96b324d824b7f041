#pragma once
// One command: its options, its help, its report and its exit code. What is common to all commands
// (docs/commands.md, "Common to all") lives here and nowhere else.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/progress.h"
#include "core/report.h"

namespace roomtex {

class OptionFields;

struct CommonOptions {
  bool quiet = false;
  int num_threads = -1;  // -1 = all
  int random_seed = 0;
  std::string project_path;  // ini file with options; the command line wins
  std::string report_path;
};

class Command {
 public:
  // name: "roomtex-import". summary: one sentence. example: a line that can be typed as it is.
  Command(const std::string& name, const std::string& summary, const std::string& example);
  ~Command();

  // Options. The default is what *value holds; the help shows it. `help` says what, unit and
  // direction. An input path option is listed among the report's inputs.
  enum class Kind { kOptional, kRequired };
  void AddBool(const std::string& name, bool* value, const std::string& help);  // 1|0, alone = 1
  void AddInt(const std::string& name, int* value, const std::string& help);
  void AddDouble(const std::string& name, double* value, const std::string& help);
  void AddString(const std::string& name, std::string* value, const std::string& help,
                 Kind kind = Kind::kOptional);
  void AddChoice(const std::string& name, std::string* value,
                 const std::vector<std::string>& choices, const std::string& help);
  void AddInputPath(const std::string& name, std::string* value, const std::string& help,
                    Kind kind = Kind::kRequired);
  void AddInputPaths(const std::string& name, std::vector<std::string>* values,
                     const std::string& help, Kind kind = Kind::kRequired);
  void AddOutputPath(const std::string& name, std::string* value, const std::string& help,
                     Kind kind = Kind::kRequired);
  void AddOutputPaths(const std::string& name, std::vector<std::string>* values,
                      const std::string& help, Kind kind = Kind::kRequired);
  // The fields that an options struct declares: command.Add(FieldsOf(&options)).
  void Add(const OptionFields& fields);
  // Takes every option whose name starts with `prefix` (e.g. "--Mapper.") together with its value
  // and hands them on in order: {"--Mapper.x", "1", ...}. For options of another program.
  void PassThrough(const std::string& prefix, std::vector<std::string>* arguments,
                   const std::string& help);

  struct Context {
    const CommonOptions& options;
    Progress& progress;
    Report& report;
    // Warns on stderr and in the report.
    void Warn(const std::string& message) const;
  };

  // Parses, runs `body`, writes the report and gives the exit code for main(). `body` throws
  // UsageError or InputError; an answer that is not to be trusted is said with
  // report.SetUntrusted(). Every other exception is an internal error (exit 1) told in one line.
  int Run(int argc, char** argv, const std::function<void(const Context&)>& body);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// roomtex's version, e.g. "0.1.0".
const char* Version();

}  // namespace roomtex
