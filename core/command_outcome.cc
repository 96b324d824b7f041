#include "core/command_outcome.h"

#include <cstdint>
#include <exception>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <utility>

#include <opencv2/core.hpp>
#include <sys/resource.h>

#include "core/child_program.h"
#include "core/resource_limits.h"

namespace roomtex {
namespace {

constexpr char kOutOfMemory[] = "out of memory";

std::string Megabytes(uintmax_t bytes) {
  return std::to_string((bytes + 999999) / 1000000) + " MB";
}

// "--scan_path room.e57 (340 MB), --image_path photos (24 files, 120 MB)"
std::string WithSizes(const std::vector<GuardedPaths::OptionPath>& inputs) {
  namespace fs = std::filesystem;
  std::string text;
  for (const auto& [name, path] : inputs) {
    std::error_code error;
    uintmax_t bytes = 0, count = 0;
    if (fs::is_directory(path, error)) {
      for (fs::directory_iterator entry(path, error), end; !error && entry != end;
           entry.increment(error)) {
        std::error_code no_file;
        if (!entry->is_regular_file(no_file)) continue;
        const uintmax_t size = entry->file_size(no_file);
        if (no_file) continue;
        bytes += size;
        ++count;
      }
      text += (text.empty() ? "" : ", ") + ("--" + name + " " + path) + " (" +
              std::to_string(count) + " files, " + Megabytes(bytes) + ")";
    } else if (const std::string file = FileOf(path); fs::is_regular_file(file, error)) {
      text += (text.empty() ? "" : ", ") + ("--" + name + " " + path) + " (" +
              Megabytes(fs::file_size(file, error)) + ")";
    }
  }
  return text;
}

}  // namespace

std::string TellMemory(const Progress& progress,
                       const std::vector<GuardedPaths::OptionPath>& inputs) {
  const std::vector<std::pair<std::string, double>>& stages = progress.stage_seconds();
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const std::string read = WithSizes(inputs);
  return std::string(kOutOfMemory) +
         (stages.empty() ? "" : " in the stage \"" + stages.back().first + "\"") + ": " +
         std::to_string(usage.ru_maxrss / 1024) + " MB were in use and more was needed, " +
         std::to_string(AvailableMemory() / 1000000) + " MB are free" +
         (read.empty() ? "" : "; read were " + read) +
         ". Give it more memory, a scan with fewer samples or smaller photos, or "
         "fewer threads (--num_threads)";
}

Outcome RunBody(const std::function<void()>& body) {
  try {
    body();
    return {};
  } catch (const UsageError& error) {
    return {kExitUsage, error.what()};
  } catch (const InputError& error) {
    return {kExitInput, error.what()};
  } catch (const Interrupted& interrupted) {
    return {kExitInternalError, "", interrupted.signal};
  } catch (const std::bad_alloc&) {
    return {kExitInput, kOutOfMemory};
  } catch (const std::length_error&) {
    return {kExitInput, kOutOfMemory};
  } catch (const std::filesystem::filesystem_error& error) {
    return {kExitInput, error.path1().string() + ": cannot be looked at (" +
                            error.code().message() + "). Check the path and its links"};
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) return {kExitInput, kOutOfMemory};
    return {kExitInternalError, "internal error: " + error.err};
  } catch (const std::exception& error) {
    // std::system_error of ours, std::runtime_error of Embree's and OpenCV's threads.
    if (std::string(error.what()).find("Resource temporarily unavailable") != std::string::npos) {
      return {kExitInput,
              "the system does not give the threads that are needed: raise ulimit -u, or the "
              "container's limit"};
    }
    return {kExitInternalError, std::string("internal error: ") + error.what()};
  } catch (...) {
    return {kExitInternalError, "internal error of an unknown kind"};
  }
}

bool Outcome::IsOutOfMemory() const { return failure == kOutOfMemory; }

}  // namespace roomtex
