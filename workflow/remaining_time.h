#pragma once
// How long a run will take still: a guess per step from the number and size of the photos,
// corrected by what the steps before took, or what the same step took the last time.

#include <map>
#include <string>
#include <vector>

namespace roomtex {

class RemainingTime {
 public:
  // What the guess stands on.
  void SetPhotos(size_t count, double megapixels) {
    num_photos_ = static_cast<double>(count);
    megapixels_ = megapixels;
  }
  // The steps still to run, in order; seconds of the last time where there was one.
  void SetSteps(const std::vector<std::string>& steps,
                const std::map<std::string, double>& seconds_last_time);
  void Finish(const std::string& step, double seconds);
  // It has not to run: says nothing of this machine.
  void Drop(const std::string& step);

  // Seconds until everything is done; `share`: of the running step that is done, negative = not
  // known; `elapsed`: its seconds so far.
  double Seconds(const std::string& running, double share, double elapsed) const;
  // Of a step, by its guess and what the steps before took.
  double Expected(const std::string& step) const;

 private:
  double Guess(const std::string& step) const;

  double num_photos_ = 30, megapixels_ = 2.5;
  std::vector<std::string> steps_;
  std::map<std::string, double> last_time_;
  double guessed_ = 0, taken_ = 0;  // of the steps that ran
};

// "3 min", "20 s".
std::string DurationText(double seconds);

// How much of a step is done by a line that its program printed ("Processed file [3/12]", "Matching
// block [1/4, 2/4]", "  sparse model [2/3]: sparse/1"); negative where it does not say.
double ShareOfLine(const std::string& line);

}  // namespace roomtex
