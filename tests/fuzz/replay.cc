// The main() of a fuzz target without libFuzzer: runs the files of a corpus, one after the other,
// and each once more cut short and with single bytes changed. What a target does not survive ends
// the program, sanitizer or not. Usage: TARGET_replay FOLDER...

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace {

constexpr int kChangesPerFile = 40;

void RunOnce(const std::vector<uint8_t>& bytes) {
  LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
}

// The same changes in every run: minstd_rand and its numbers are fixed by the standard.
void RunChanged(const std::vector<uint8_t>& bytes) {
  std::minstd_rand random(static_cast<uint32_t>(bytes.size()) + 1);
  for (int i = 0; i < kChangesPerFile && !bytes.empty(); ++i) {
    std::vector<uint8_t> changed = bytes;
    const size_t at = random() % changed.size();
    switch (i % 4) {
      case 0:
        changed.resize(at);
        break;
      case 1:
        changed[at] ^= static_cast<uint8_t>(1u << random() % 8);
        break;
      case 2:
        changed[at] = i % 8 == 2 ? 0xff : 0;
        break;
      case 3:
        changed.insert(changed.begin() + static_cast<int64_t>(at), changed[at]);
        break;
    }
    RunOnce(changed);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    for (const auto& entry : std::filesystem::directory_iterator(argv[i])) {
      if (entry.is_regular_file()) paths.push_back(entry.path().string());
    }
  }
  std::sort(paths.begin(), paths.end());
  for (const std::string& path : paths) {
    std::ifstream stream(path, std::ios::binary);
    const std::vector<uint8_t> bytes{std::istreambuf_iterator<char>(stream),
                                     std::istreambuf_iterator<char>()};
    std::fprintf(stderr, "%s (%zu bytes)\n", path.c_str(), bytes.size());
    RunOnce(bytes);
    RunChanged(bytes);
  }
  std::printf("%zu files\n", paths.size());
  return paths.empty() ? 1 : 0;
}
