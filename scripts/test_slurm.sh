#!/usr/bin/env bash
# Slurm for real: a controller and three nodes on this machine run a site of six small rooms (docs/site.md). A node
# dies and a job is killed midway; at the end every room is done, what was killed was tried again with twice the memory,
# and what our own steps wrote is, byte for byte, what one core makes of the same databases. Not in the gate (label
# slow): needs root, the packages of scripts/setup.sh --slurm, and some five minutes of processor.
# Usage: scripts/test_slurm.sh [--bin FOLDER] [FOLDER]
#   --bin: roomtex's commands; default: build/bin. FOLDER: for all that is made, new or empty; default: one in /tmp,
#   removed. Ends with 77 where it cannot be tried.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
bin=$root/build/bin
if [ "${1:-}" = --bin ]; then
  bin=$(cd "$2" && pwd)
  shift 2
fi
export PATH="$bin:$PATH:/usr/sbin" USER="${USER:-$(id -un)}"

[ "$(id -u)" -eq 0 ] || { echo "test_slurm: needs root, as slurmd does." >&2; exit 77; }
for program in snakemake slurmctld slurmd munged sbatch; do
  command -v $program >/dev/null ||
    { echo "test_slurm: $program is missing; run scripts/setup.sh --slurm." >&2; exit 77; }
done
for program in simulate auto pairs merge mapper align texture render join site; do
  [ -x "$bin/roomtex-$program" ] ||
    { echo "test_slurm: $bin has no roomtex-$program; build roomtex, or name its folder by --bin." >&2; exit 1; }
done
work=${1:-}
keep=1
if [ -z "$work" ]; then
  work=$(mktemp -d)
  keep=0
fi
mkdir -p "$work"
work=$(cd "$work" && pwd)
[ -z "$(ls -A "$work")" ] || { echo "test_slurm: $work is not empty." >&2; exit 1; }

say() { printf '%s %s\n' "$(date +%T)" "$*"; }
fail() {
  say "FAILED: $*"
  exit 1
}

# ---- a cluster of our own: its ports, keys and folders are nobody else's

daemons=()
cluster=$work/cluster
export SLURM_CONF=$cluster/slurm.conf
start() {
  "$@" &
  daemons+=($!)
}

# The processes of the jobs on a node, and the slurmstepd above them.
processes_on() {
  local pid above
  for pid in /proc/[0-9]*; do
    grep -qzxF "SLURMD_NODENAME=$1" "$pid/environ" 2>/dev/null || continue
    grep -qzxF "SLURM_CONF=$SLURM_CONF" "$pid/environ" 2>/dev/null || continue
    echo "${pid#/proc/}"
    above=$(awk '$1 == "PPid:" { print $2 }' "$pid/status" 2>/dev/null) || continue
    case $(tr '\0' ' ' <"/proc/$above/cmdline" 2>/dev/null) in slurmstepd:*) echo "$above" ;; esac
  done | sort -un
}

finish() {
  scancel --user="$USER" >/dev/null 2>&1 || true
  for node in n1 n2 n3; do
    processes_on $node | xargs -r kill -KILL 2>/dev/null || true
  done
  kill "${daemons[@]}" 2>/dev/null || true
  wait 2>/dev/null || true
  [ $keep -eq 1 ] || rm -rf "$work"
}
trap finish EXIT

mkdir -p "$cluster"/{state,n1,n2,n3}
chmod 755 "$work" "$cluster"
port=$((20000 + RANDOM % 20000))
(umask 077 && head -c 1024 /dev/urandom >"$cluster/munge.key")
host=$(hostname -s)
cat >"$SLURM_CONF" <<EOF
ClusterName=site
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$cluster/munge.socket
StateSaveLocation=$cluster/state
SlurmdSpoolDir=$cluster/%n
SlurmctldPidFile=$cluster/slurmctld.pid
SlurmdPidFile=$cluster/%n.pid
SlurmctldLogFile=$cluster/slurmctld.log
SlurmdLogFile=$cluster/%n.log
SwitchType=switch/none
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SlurmdParameters=config_overrides
SchedulerParameters=batch_sched_delay=1,sched_interval=2
SlurmdTimeout=10
KillWait=5
JobRequeue=1
MinJobAge=3600
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 1)) CPUs=2 RealMemory=6000
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 2)) CPUs=2 RealMemory=6000
NodeName=n3 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 3)) CPUs=2 RealMemory=6000
PartitionName=rooms Nodes=n1,n2,n3 Default=YES MaxTime=INFINITE State=UP
EOF
start munged --foreground --force --key-file="$cluster/munge.key" --socket="$cluster/munge.socket" \
  --pid-file="$cluster/munge.pid" --log-file="$cluster/munge.log" --seed-file="$cluster/munge.seed" \
  >"$cluster/munged.out" 2>&1
for _ in $(seq 50); do [ -S "$cluster/munge.socket" ] && break; sleep 0.1; done
start slurmctld -D >"$cluster/slurmctld.out" 2>&1
declare -A slurmd
for node in n1 n2 n3; do
  start slurmd -D -N $node >"$cluster/$node.out" 2>&1
  slurmd[$node]=$!
done
for _ in $(seq 60); do [ "$(sinfo -h -t idle -o %D 2>/dev/null)" = 3 ] && break; sleep 0.5; done
[ "$(sinfo -h -t idle -o %D)" = 3 ] || { tail -n 5 "$cluster"/*.log "$cluster"/*.out; fail "the three nodes do not start"; }
say "three nodes are up"

# ---- six rooms; the last with the scan of another and without picks, which is not to be trusted

site=$work/site
mkdir "$site"
echo "room,photos,scans,picks,cameras,options" >"$site/site.csv"
seeds=(0 1 2 3 4 7 6)  # one pick of seed 5 lies beside its photo
for i in 1 2 3 4 5 6; do
  roomtex-simulate --quiet --output_path "$site/room$i" --random_seed ${seeds[i]} --num_photos 12 --photo_width 640 \
    --photo_height 427 --scan_columns 500 --scan_rows 200 >/dev/null
  known="room$i/picks.csv,room$i/cameras.txt"
  [ $i -lt 6 ] || known=","
  scan=room$i/scan.rtpi
  [ $i -lt 6 ] || scan=room1/scan.rtpi
  # The matches of the first are made in two parts.
  echo "r$i,room$i/photos,$scan,$known,$([ $i -gt 1 ] || echo "--pairs 1")" >>"$site/site.csv"
done
say "six rooms are simulated"

options="--quality low"
max_mem_mb=5000
run_site() {
  snakemake -s "$root/workflow/site/Snakefile" --profile "$root/workflow/site/slurm" --directory "$site" \
    --latency-wait 10 --max-status-checks-per-second 1 \
    --config bin="$bin" threads=2 "options=$options" photos_per_part=6 max_mem_mb=$max_mem_mb "$@"
}
run_site >"$work/snakemake.log" 2>&1 &
snakemake=$!

# Waits until a step has begun somewhere; fails if the site ends before.
wait_for() {
  for _ in $(seq 1200); do
    eval "$1" && return 0
    kill -0 $snakemake 2>/dev/null || { tail -n 40 "$work/snakemake.log"; fail "the site ended before: $1"; }
    sleep 0.25
  done
  fail "did not happen: $1"
}
# Jobs that run, as "ID NAME"; Snakemake names them snakejob_RULE_NUMBER, all tries of one alike.
running() { squeue -h -t R -o '%A %j'; }
rule_of() {
  local rule=${1#snakejob_}
  echo "${rule%_*}"
}
# By what Snakemake said when it began the job for the first time.
room_of() {
  awk -v number="${1##*_}" '$1 == "jobid:" { id = $2 }
    $1 == "wildcards:" && id == number { match($0, /room=[^,]*/); print substr($0, RSTART + 5, RLENGTH - 5); exit }' \
    "$work/snakemake.log"
}
# What roomtex-auto has to say of a step of a room: started, done, untrusted, failed, or nothing.
state_of() {
  python3 - "$site/result/$1/steps.json" "$2" <<'END'
import json, sys
try:
    print(json.load(open(sys.argv[1]))["steps"][sys.argv[2]]["state"])
except (OSError, ValueError, KeyError):
    print("")
END
}
was_interrupted() { head -n 1 "$site/result/$1/log/$2.log" | grep -q ", it was interrupted$"; }

# A node loses its power while COLMAP matches on it.
matching_node() {
  local node
  for node in $(squeue -h -t R -o '%N %j' | awk '/part|matches/ { print $1 }' | sort -u); do
    processes_on "$node" | xargs -r ps -o comm= -p 2>/dev/null | grep -qx colmap && echo "$node" && return
  done
  return 0
}
node=""
wait_for 'node=$(matching_node); [ -n "$node" ]'
lost=$(squeue -h -w "$node" -t R -o %j | tr '\n' ' ')
disown "${slurmd[$node]}"
kill -KILL "${slurmd[$node]}"
processes_on "$node" | xargs -r kill -KILL 2>/dev/null || true
say "node $node is dead, with it $lost"

# A job is killed whose step has begun, as its log says. Where the step was faster than Slurm, it is done, and another
# one has to serve.
begun_job() {
  local job name
  while read -r job name; do
    case $(rule_of "$name") in mapper | align | texture) ;; *) continue ;; esac
    [ -s "$site/result/$(room_of "$name")/log/$(rule_of "$name").log" ] && echo "$job $name" && return
  done < <(running)
  return 0
}
killed=""
for _ in 1 2 3 4; do
  begun=""
  wait_for 'begun=$(begun_job); [ -n "$begun" ]'
  read -r job name <<<"$begun"
  scancel "$job"
  room=$(room_of "$name") step=$(rule_of "$name")
  wait_for '[ -z "$(squeue -h -t R,CG -j "$job" -o %A)" ]'
  if [ "$(state_of "$room" "$step")" = started ] || was_interrupted "$room" "$step"; then
    killed=$name
    break
  fi
  say "job $job was cancelled, but the step $step of $room had ended"
done
[ -n "$killed" ] || fail "no job was killed while its step ran"
say "job $job is killed in the step $step of $room"

code=0
wait $snakemake || code=$?
[ $code -eq 0 ] || { tail -n 60 "$work/snakemake.log"; fail "snakemake ended with $code"; }
say "the site is done"

# ---- every room is done, and once

for i in 1 2 3 4 5 6; do
  expected=$([ $i -lt 6 ] && echo "done" || echo untrusted)
  state=$(cat "$site/result/r$i/log/pictures.state")
  [ "$state" = "$expected" ] || fail "room r$i is $state"
done
grep -q "SLURM status is: 'CANCELLED'" "$work/snakemake.log" || fail "the killed job was not seen"
sinfo -h -o '%N %T' | grep -q "$node.*down" || fail "node $node is not down"
# Only what was killed has begun twice.
was_interrupted "$room" "$step" || fail "the step $step of $room was not begun twice"
twice=$(sed -n 's/^roomtex-auto [^:]*: [a-z]*, //p' "$site"/result/*/log/*.log | { grep -vx "for the first time" || true; } | sort | uniq -c)
say "begun again: ${twice:-nothing}"
[ -z "$(sed 's/^ *[0-9]* //' <<<"$twice" | grep -vx "it was interrupted" || true)" ] || fail "steps were run again"
# The second try had twice the memory, as far as there is as much; those of the dead node Slurm began again by itself.
tries=$(squeue -h --noconvert -t all -n "$killed" -S i -o '%m %T')
say "the tries of $killed: $(tr '\n' ',' <<<"$tries")"
[ "$(awk '{ print $2 }' <<<"$tries" | xargs)" = "CANCELLED COMPLETED" ] || fail "it was not tried twice"
awk -v most=$max_mem_mb '{ asked[NR] = $1 + 0 }
  END { twice = 2 * asked[1]; exit !(asked[1] > 0 && asked[2] == (twice < most ? twice : most)) }' <<<"$tries" ||
  fail "the second try did not ask for twice the memory"
for name in $lost; do
  squeue -h -t all -n "$name" -o %T | grep -qx COMPLETED || fail "$name of the dead node was not done elsewhere"
done
python3 - "$site/result/site.json" <<'EOF' || fail "site.json says otherwise"
import json, sys
site = json.load(open(sys.argv[1]))
print(site["verdict"]["headline"], site["counts"])
assert site["counts"] == {"rooms": 6, "trusted": 5, "untrusted": 1, "failed": 0, "unfinished": 0}
assert [len(room["places_to_photograph"]) > 0 for room in site["rooms"]] == 5 * [True] + [False]
EOF
run_site >"$work/again.log" 2>&1 || fail "started again it fails"
grep -q "Nothing to be done" "$work/again.log" || fail "started again it does something"

# ---- one core, the same databases, the same bytes

reference=$work/reference
mkdir "$reference"
for i in 1 2 3 4 5 6; do
  ln -s "$site/room$i" "$reference/room$i"
  mkdir -p "$reference/result/r$i"
  cp "$site/result/r$i/database.db" "$reference/result/r$i/"
  known="--picks_path room$i/picks.csv --cameras_path room$i/cameras.txt"
  scan=room$i/scan.rtpi
  [ $i -lt 6 ] || known="" scan=room1/scan.rtpi
  code=0
  # shellcheck disable=SC2086
  (cd "$reference" && taskset -c 0 roomtex-auto --quiet --image_path room$i/photos --scan_path $scan $known \
    --output_path result/r$i $options --num_threads 1 --from mapper --until pictures) >"$work/r$i.log" 2>&1 || code=$?
  [ $code -eq "$([ $i -lt 6 ] && echo 0 || echo 4)" ] || { cat "$work/r$i.log"; fail "the reference of r$i ended with $code"; }
  for folder in sparse aligned textured pictures; do
    [ -e "$reference/result/r$i/$folder" ] || continue
    diff -rq --exclude='*.json' --exclude='*.log' "$reference/result/r$i/$folder" "$site/result/r$i/$folder" || fail "r$i/$folder differs"
  done
  [ $i -eq 6 ] || cmp "$reference/result/r$i/log/plan.png" "$site/result/r$i/log/plan.png" || fail "the plan of r$i differs"
done
# Reports, without times, memory, the number of threads and where the scan lies from here.
python3 - "$reference/result" "$site/result" <<'END' || fail "reports differ"
import json, pathlib, sys
ours, theirs = map(pathlib.Path, sys.argv[1:])
LEFT_OUT = {"seconds", "cpu_seconds", "peak_memory_bytes", "num_threads", "relative_path"}
def lasting(value):
    if isinstance(value, dict):
        return {key: lasting(one) for key, one in value.items() if key not in LEFT_OUT}
    return [lasting(one) for one in value] if isinstance(value, list) else value
def differences(a, b, where=""):
    if isinstance(a, dict) and isinstance(b, dict):
        for key in sorted(a.keys() | b.keys()):
            yield from differences(a.get(key), b.get(key), f"{where}/{key}")
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for i, (one, other) in enumerate(zip(a, b)):
            yield from differences(one, other, f"{where}/{i}")
    elif a != b:
        yield f"{where}: {str(a)[:200]} and {str(b)[:200]}"
reports = set()
for root in (ours, theirs):
    for room in root.glob("r[0-9]"):
        names = [f"log/{step}.json" for step in ("mapper", "align", "texture", "pictures")]
        found = [room / name for name in names if (room / name).exists()]
        for folder in ("sparse", "aligned", "textured", "pictures"):
            found += (room / folder).rglob("*.json")
        reports |= {path.relative_to(root) for path in found}
wrong = 0
for path in sorted(reports):
    if not ((ours / path).exists() and (theirs / path).exists()):
        wrong += 1
        print(f"{path}: only one of the two has it")
        continue
    for difference in differences(*(lasting(json.loads((root / path).read_text())) for root in (ours, theirs))):
        wrong += 1
        print(f"{path}: {difference}")
print(len(reports), "reports are the same but for times, memory, threads and paths" if wrong == 0 else "reports")
sys.exit(wrong > 0 or not reports)
END
say "$(find "$reference"/result/*/{sparse,aligned,textured,pictures} -type f ! -name "*.json" ! -name "*.log" | wc -l) files are the same as on one core"
echo "test_slurm: passed"
