#pragma once
// Standard input, output and error of a command, and the folder that it works in.

#include <string>

#include "core/input_guard.h"

namespace roomtex {

// Those that are closed become /dev/null: the next file that is opened would take their place, and
// what is told would be written into it.
void OpenStandardFiles();

// Told on standard output by Command::Run() once all that the command made is in its place: who
// reads a path there finds it. Nothing is told if the command fails before.
void AnswerAtEnd(const std::string& text);
// Told however the command ends, once its report is in its place, if that could be written.
void AnswerAtAnyEnd(const std::string& text);
// For Command::Run(): what is to be told.
std::string TakeAnswer(bool ran_to_end);

// Whether all that was told on standard output arrived; if not, says so on standard error.
bool FlushAnswer(const std::string& command);

// Throws InputError if the folder that one works in is gone and a path begins there.
void RequireWorkingFolder(const GuardedPaths& paths);

}  // namespace roomtex
