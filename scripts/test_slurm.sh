#!/usr/bin/env bash
# Slurm for real: a controller and three nodes on this machine run a site of six small rooms (docs/site.md). A node
# dies and a job is killed midway; at the end every room is done, and what our own steps wrote is, byte for byte, what
# one core makes of the same databases. Not in the gate: needs the packages slurm-wlm, munge and snakemake, root, and
# some five minutes of processor.
# Usage: scripts/test_slurm.sh [FOLDER]    FOLDER: for all that is made, new or empty; default: one in /tmp, removed
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
export PATH="$root/build/bin:$PATH" USER="${USER:-$(id -un)}"

[ "$(id -u)" -eq 0 ] || { echo "test_slurm: needs root, as slurmd does." >&2; exit 1; }
for program in snakemake slurmctld slurmd munged sbatch roomtex-simulate roomtex-auto roomtex-join roomtex-site; do
  PATH="$PATH:/usr/sbin" command -v $program >/dev/null ||
    { echo "test_slurm: $program is missing; apt-get install snakemake slurm-wlm munge, and build roomtex." >&2; exit 1; }
done
export PATH="$PATH:/usr/sbin"
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
run_site() {
  snakemake -s "$root/workflow/site/Snakefile" --profile "$root/workflow/site/slurm" --directory "$site" \
    --latency-wait 10 --max-status-checks-per-second 1 \
    --config bin="$root/build/bin" threads=2 "options=$options" photos_per_part=6 max_mem_mb=5000 "$@"
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
busy_node() { squeue -h -t R -o '%N %j' | awk -v job="$1" '$2 ~ job { print $1; exit }'; }

# A node loses its power while it works.
wait_for '[ -n "$(busy_node "part|matches")" ]'
node=$(busy_node "part|matches")
lost=$(squeue -h -w "$node" -t R -o %A | tr '\n' ' ')
kill -KILL "${slurmd[$node]}"
processes_on "$node" | xargs -r kill -KILL 2>/dev/null || true
say "node $node is dead, jobs ${lost}with it"

# A job is killed in another step.
wait_for '[ -n "$(squeue -h -t R -o "%A %j" | grep -E "mapper|align|texture" | head -n 1)" ]'
job=$(squeue -h -t R -o '%A %j' | grep -E "mapper|align|texture" | head -n 1 | cut -d ' ' -f 1)
scancel "$job"
say "job $job is killed"

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
twice=$(sed -n 's/^roomtex-auto [^:]*: [a-z]*, //p' "$site"/result/*/log/*.log | { grep -vx "for the first time" || true; } | sort | uniq -c)
say "begun again: ${twice:-nothing}"
[ -z "$(sed 's/^ *[0-9]* //' <<<"$twice" | grep -vx "it was interrupted" || true)" ] || fail "steps were run again"
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
    --output_path result/r$i $options --num_threads 1 --from mapper --until texture) >"$work/r$i.log" 2>&1 || code=$?
  [ $code -eq "$([ $i -lt 6 ] && echo 0 || echo 4)" ] || { cat "$work/r$i.log"; fail "the reference of r$i ended with $code"; }
  for folder in sparse aligned textured; do
    [ -e "$reference/result/r$i/$folder" ] || continue
    # Reports and logs hold times.
    diff -rq --exclude='*.json' --exclude='*.log' "$reference/result/r$i/$folder" "$site/result/r$i/$folder" || fail "r$i/$folder differs"
  done
done
say "$(find "$reference"/result/*/{sparse,aligned,textured} -type f ! -name "*.json" ! -name "*.log" | wc -l) files are the same as on one core"
echo "test_slurm: passed"
