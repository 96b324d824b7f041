#pragma once
// What the machine does not give: memory and threads.

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <thread>

namespace roomtex {

// Bytes that may still be allocated: the least of what the machine has free, of the limit of this
// process (ulimit -v) and of that of its container. A guess, for refusing what cannot fit.
int64_t AvailableMemory();

// Throws InputError if the work on `path` takes more than is available, in time: "room.e57: reading
// 80 million samples takes 17.4 GB, and 6.1 GB are free. ..." what: "reading 80 million samples".
void RequireMemory(const std::string& path, const std::string& what, double num_bytes,
                   const std::string& remedy);

// Bytes of memory that commands take per sample of a scan (docs/reliability.md says how measured).
inline constexpr double kLookBytesPerSample = 80, kImportBytesPerSample = 110,
                        kAlignBytesPerSample = 112, kTextureBytesPerSample = 280,
                        kExportBytesPerSample = 234, kDenseBytesPerSample = 301;

// What a command does with the samples of all scans that it reads while this lives: what they take
// in the end is compared with what is free before room is made for any. One at a time.
class SampleWork {
 public:
  // what: "colouring". max_samples: of several scans with more no more are held in the end, since
  // they are thinned out as they are read; the largest one is there in full beside them, for which
  // the command takes bytes_per_full_sample.
  SampleWork(const std::string& what, double bytes_per_sample,
             double max_samples = std::numeric_limits<double>::infinity(),
             double bytes_per_full_sample = kImportBytesPerSample);
  ~SampleWork();
  SampleWork(const SampleWork&) = delete;
  SampleWork& operator=(const SampleWork&) = delete;
};
// A reader knows from header or size of the file that so many samples come, and has not made room
// for them yet. largest: of those of its scans that has most; 0 = there is one. Throws InputError
// if the work on them and on those before takes more memory than was free when it began; without a
// SampleWork, if reading these alone does.
void RequireMemoryForSamples(const std::string& path, double count, double largest = 0);

// The same for --help: "Takes about 86 bytes of memory a sample." bounded: of at most
// --max_samples.
std::string BytesPerSampleHelp(double bytes, bool bounded = false);

// Threads that could not be started since the start of the process (ulimit -u, a container's
// limit): the work was done by fewer.
int ThreadsNotStarted();
void NoteThreadNotStarted();
// Throws std::system_error, and notes it, where the system does not give another thread.
std::thread StartThread(std::function<void()> work);
// Tries whether so many threads can run side by side. Libraries that have threads of their own end
// with the first that is missing: they are told to do without.
void ProbeThreads(int count);

}  // namespace roomtex
