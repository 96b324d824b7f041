#!/usr/bin/env bash
# Threaded code under the thread sanitizer: the servers, ParallelFor and what runs by it, reading, colouring, searching,
# simulating, finding boards and pairs. (What has threads in dense/ is tested by its command only.) Before a release; a
# build of its own (build-tsan) and some minutes. Usage: scripts/test_threads.sh [TEST...]
set -euo pipefail
cd "$(dirname "$0")/.."
tests=("$@")
if [ ${#tests[@]} = 0 ]; then
  tests=(core_test server_test importers_test colmap_ext_test texture_test view_test align_pick_server_test
    align_search_test capture_test calibration_test associate_test)
fi
# Libraries that are not built for it synchronise by what it does not see. (Embree compares strings of its own by
# libstdc++, and what is below that on the stack cannot be told.)
mkdir -p build-tsan
cat >build-tsan/suppressions.txt <<'END'
called_from_lib:libembree
called_from_lib:libtbb.so
called_from_lib:libopencv_core
called_from_lib:libceres
race:libembree
race:libopencv_aruco
race:libopencv_calib3d
race:libopencv_features2d
mutex:libopencv_features2d
race:std::allocator<char> >::compare(char const
race:libtbb
race:libcpp-httplib
deadlock:libgdal
mutex:libgdal
mutex:libOpenNI2
mutex:__GI___nptl_deallocate_tsd
END
# Long statistics, and tests that start commands, which are not built here.
left_out='ModelCheck.*:LensCheck.*:Initializer.IsRightBeforeAWall:*Command.*:*Benchmark*'
left_out+=':FoundPhotos.*:StartVerdict.*:AutomaticAlignment.*:Calibration.*:CalibrationUncertainty.*:*PhotosOfLens.*'
left_out+=':Associate.Command*'
# In the child of a program with threads the sanitizer runs no handler of a signal: it would wait for ever.
left_out+=':LocalServer.SignalsEndTheProcessCleanly'
export GTEST_FILTER="${GTEST_FILTER:--$left_out}"
export TSAN_OPTIONS="suppressions=$PWD/build-tsan/suppressions.txt die_after_fork=0 exitcode=66 second_deadlock_stack=1"
cmake --preset tsan >/dev/null
cmake --build --preset tsan --target "${tests[@]}"
failed=0
for test in "${tests[@]}"; do
  log=build-tsan/$test.log
  if timeout 1800 build-tsan/bin/"$test" >"$log" 2>&1; then
    echo "$test: $(tail -n 1 "$log")"
  else
    grep -A 25 'WARNING: ThreadSanitizer\|^\[  FAILED' "$log" | head -n 80 || true
    echo "$test: FAILED, $(grep -c 'WARNING: ThreadSanitizer' "$log") reports (see $log)"
    failed=1
  fi
done
exit "$failed"
