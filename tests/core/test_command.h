#pragma once
// A command with one option of every kind.

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/command_line.h"

namespace roomtex {

// Run as main() would.
struct TestCommand {
  bool detail = true;
  int count = 7;
  double ratio = 0.25;
  double range = std::numeric_limits<double>::infinity();
  std::string title = "a title";
  std::string mode = "exif";
  std::string input, output;
  std::vector<std::string> scans, mapper;
  CommonOptions common;
  std::string out, err;
  int num_runs = 0;

  int Run(std::vector<std::string> arguments,
          const std::function<void(const Command::Context&)>& body = nullptr) {
    Command command("roomtex-test", "Does nothing.", "roomtex-test --input_path a --output_path b");
    command.AddInputPath("input_path", &input, "What enters.");
    command.AddOutputPath("output_path", &output, "What leaves.", Command::Kind::kOptional);
    command.AddInputPaths("scan_path", &scans, "Scans.", Command::Kind::kOptional);
    command.AddBool("detail", &detail, "Keep details.");
    command.AddInt("count", &count, "How many.");
    command.AddDouble("Group.ratio", &ratio, "How much, metres.");
    command.AddDouble("range", &range, "How far, metres.");
    command.AddString("title", &title, "What to call it.");
    command.AddChoice("mode", &mode, {"exif", "match", "none"}, "Which one.");
    command.PassThrough("--Mapper.", &mapper, "Handed on to colmap mapper.");
    arguments.insert(arguments.begin(), "roomtex-test");
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int exit_code = command.Run(static_cast<int>(argv.size()), argv.data(),
                                      [&](const Command::Context& context) {
                                        ++num_runs;
                                        common = context.options;
                                        if (body) body(context);
                                      });
    out = testing::internal::GetCapturedStdout();
    err = testing::internal::GetCapturedStderr();
    return exit_code;
  }

  int RunWithInput(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--input_path", "in"});
    return Run(arguments);
  }
};

}  // namespace roomtex
