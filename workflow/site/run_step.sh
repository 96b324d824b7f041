#!/usr/bin/env bash
# One step of a room, told by the room's state: nothing is done behind a step that is not to be trusted, but for the
# mapper, of which roomtex-auto knows whether the next step has the last word.
# Usage: run_step.sh STATE [STATE_BEFORE] roomtex-auto ARGUMENTS...
# STATE becomes "done" or "untrusted"; the end of a step that failed is the command's. What it said then, into the log
# beside STATE, stays in `refused` until a step of the room runs to its end: roomtex-site tells it.
set -euo pipefail
state=$1
shift
if [ "$1" != roomtex-auto ]; then
  before=$1
  shift
  if [ "$(cat "$before")" != "done" ] && [ "$(basename "$before")" != mapper.state ]; then
    cp "$before" "$state"
    exit 0
  fi
fi
refused=$(dirname "$state")/refused
code=0
"$@" || code=$?
case $code in
  0) echo "done" >"$state" ;;
  4) echo untrusted >"$state" ;;
  *)
    tail -n 20 "${state%.state}.run.log" >"$refused" 2>/dev/null || rm -f "$refused"
    exit "$code"
    ;;
esac
rm -f "$refused"
