#pragma once
// The picks of one run of roomtex-pick: kept, solved, and saved after every change.

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "align/pick/pick_solution.h"
#include "core/saved_file.h"

namespace roomtex {

class PickSession {
 public:
  // What stands at one moment; never changes.
  struct Snapshot {
    int revision = 1;
    std::vector<SessionPick> picks;
    PickSolution solution;
    int solution_number = 1;  // another one: another solution
    bool saved = true;        // the file holds these picks
    std::string save_error;   // why it does not
    double milliseconds = 0;
  };

  // Continues the picks file if there is one. Throws InputError: a broken file, or picks that do
  // not belong to the model.
  PickSession(const PickScene& scene, const std::string& picks_path);

  const std::string& picks_path() const { return file_.path(); }
  std::shared_ptr<const Snapshot> Now() const;
  // Solves again once what is made in the background stands; the revision stays.
  std::shared_ptr<const Snapshot> Refresh();

  // Takes these picks instead of the ones of `revision`, solves, and saves. Throws UsageError if
  // that is no longer the revision, or if the picks are none that a file could hold (a pixel twice
  // ...). A file that cannot be written is said in the snapshot.
  std::shared_ptr<const Snapshot> Put(int revision, std::vector<SessionPick> picks);
  // What the search of roomtex-align has found, in place of what it found before; null = nothing.
  // The revision stays.
  void TakeFound(std::shared_ptr<const FoundPlaces> found);
  // Tries to write picks that could not be saved before. False: still not. Over a file that was
  // changed elsewhere only with over_others: where a person goes on from these picks.
  bool SaveAgain(bool over_others);

 private:
  void Read();
  std::string Save(const std::vector<SessionPick>& picks);
  std::shared_ptr<const Snapshot> Publish(Snapshot snapshot);
  void SolveInto(Snapshot* snapshot);

  const PickScene& scene_;
  SavedFile file_;
  std::mutex changing_;             // one change at a time; held while solving
  bool changed_elsewhere_ = false;  // the file, when the picks were to be saved; under changing_
  PickSolver solver_;
  mutable std::mutex mutex_;  // of now_, held briefly
  std::shared_ptr<const Snapshot> now_;
};

}  // namespace roomtex
