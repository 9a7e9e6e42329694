#!/usr/bin/env bash
# Renders a picture in parts on real Slurm, with the scripts of the manual's page on jobs, kills a task half-way, and compares the
# merged picture with one rendered without Slurm. Debian's Slurm and munge are installed if they are missing and started here, as root,
# on the loopback address, with everything of theirs in one temporary folder.
#
# usage: tests/slurm.sh WHITTED [LOG-FOLDER]
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
whitted=$(realpath "$1")
[ "$(id -u)" -eq 0 ] || { echo "slurm: not root, nothing checked"; exit 0; }
if ! command -v slurmctld slurmd munged >/dev/null; then
    apt-get update -q >/dev/null || true
    apt-get install -y --no-install-recommends slurm-wlm munge >/dev/null
fi

work=$(mktemp -d)
logs=${2:-$work/logs}
mkdir -p "$logs" "$work"/{munge,state,spool,bin,run}
cleanup() {
    for name in slurmd slurmctld munged; do
        if [ -s "$work/run/$name.pid" ]; then kill "$(cat "$work/run/$name.pid")" 2>/dev/null || true; fi
    done
    sleep 1
    rm -rf "$work"
}
trap cleanup EXIT

# Munge wants its socket where all may go and its key where none may look.
chmod 755 "$work" "$work/run"
chmod 700 "$work/munge"
dd if=/dev/urandom of="$work/munge/key" bs=128 count=1 status=none
chmod 400 "$work/munge/key"
munged --force --key-file "$work/munge/key" --seed-file "$work/munge/seed" --log-file "$work/munge/log" \
    --socket "$work/run/munge.socket" --pid-file "$work/run/munged.pid"

memory=$(awk '/MemTotal/ { print int($2 / 1024 * 0.9) }' /proc/meminfo)
port=$((20000 + RANDOM % 20000))
cat >"$work/slurm.conf" <<CONF
ClusterName=whitted
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort=$port
SlurmdPort=$((port + 1))
AuthType=auth/munge
AuthInfo=socket=$work/run/munge.socket
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/run/slurmctld.pid
SlurmdPidFile=$work/run/slurmd.pid
SlurmctldLogFile=$logs/slurmctld.log
SlurmdLogFile=$logs/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
KillWait=2
NodeName=localhost NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$memory State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$work/slurm.conf
slurmctld -c
slurmd -N localhost
for _ in $(seq 60); do
    sleep 0.5
    if sinfo -h -o %T 2>/dev/null | grep -q idle; then break; fi
done
sinfo -h -o 'slurm: %N is %T with %c processors'
sinfo -h -o %T | grep -q idle || { tail -20 "$logs"/*.log; exit 1; }

# The manual's scripts, its first two blocks of bash, for 8 tasks of a processor each.
block() {
    awk -v wanted="$1" '/^```bash$/ { inside = ++count == wanted; next } /^```$/ { inside = 0 } inside' "$root/src/manual/jobs.md"
}
cd "$work/bin"
block 1 >render.sbatch
block 2 | sed -e 's/of16/of8/' -e 's/--parsable/& --array=1-8 --cpus-per-task=1/' -e 's/^sbatch/merge=$(sbatch --parsable/' -e '$s/$/)/' >submit
# A scene that takes each task some seconds.
sed -e 's/^samples = .*/samples = 100/' -e "s:\.\./meshes:$root/meshes:" "$root/scenes/mirrors.toml" >scene.toml
ln -s "$whitted" whitted
export PATH=$work/bin:$PATH
source ./submit
echo "slurm: array $job and merge $merge are queued"

# The first task that has kept some tiles is killed.
victim=
for _ in $(seq 600); do
    sleep 0.05
    for kept in big.exr.*of8.part.tiles; do
        [ -e "$kept" ] && [ "$(stat -c %s "$kept")" -gt 60000 ] || continue
        number=${kept#big.exr.}
        number=${number%of8.part.tiles}
        victim=$(pgrep -f 'whitted render scene.toml' | while read -r pid; do
            if tr '\0' '\n' <"/proc/$pid/environ" 2>/dev/null | grep -qx "SLURM_ARRAY_TASK_ID=$number" &&
                [ "$(cat "/proc/$pid/comm" 2>/dev/null)" = whitted ]; then echo "$pid"; break; fi
        done)
        [ -n "$victim" ] && break
    done
    [ -n "$victim" ] && break
done
[ -n "$victim" ] || { echo "slurm: no task could be killed half-way"; squeue; tail -n 3 big-*.log; exit 1; }
before=$(stat -c %s "$kept")
kill -KILL "$victim"
echo "slurm: killed task $number with $before bytes of tiles kept"

# Slurm lets what was requeued wait for two minutes; a task that waits for that is let go at once.
for _ in $(seq 600); do
    sleep 0.5
    squeue -h -r -o '%i %r' | awk '$2 == "BeginTime" { print $1 }' | while read -r waiting; do
        scontrol update jobid="$waiting" StartTime=now
        echo "slurm: task $waiting is requeued"
    done
    squeue -h -o %i 2>/dev/null | grep -q . || break
done
cp big-*.log "$logs/"
squeue -h -o 'slurm: %i is %T, %r'
cat big-merge.log
[ -s big.exr ] || { tail -n 5 big-*.log; exit 1; }
grep -H 'requeue\|CANCELLED\|Killed' "big-$job-$number.log" || true
whitted render scene.toml -o alone.exr --quiet
cmp big.exr alone.exr
echo "slurm: 8 parts, one of them killed and requeued, make the picture of one process, byte for byte"
