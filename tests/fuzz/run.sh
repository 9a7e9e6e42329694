#!/bin/sh
# Runs every fuzz target, or those that are named, for SECONDS each; ends with 1 if one found something.
#
# usage: tests/fuzz/run.sh SECONDS [TARGET...]
#
# Needs a nightly toolchain and cargo-fuzz. One job, 2 GiB, 10 s an input. What was found lies in tests/fuzz/artifacts.
set -u
seconds=${1:?usage: tests/fuzz/run.sh SECONDS [TARGET...]}
shift
cd "$(dirname "$0")/../.." || exit 1
[ $# -gt 0 ] || set -- obj mtl gltf glb scene_file
result=0
for target in "$@"; do
    echo "== $target, $seconds s"
    mkdir -p "tests/fuzz/corpus/$target"
    cargo +nightly fuzz run --fuzz-dir tests/fuzz "$target" "tests/fuzz/corpus/$target" "tests/fuzz/seeds/$target" -- \
        -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -max_len=16384 -print_final_stats=1 \
        -dict="$PWD/tests/fuzz/dictionaries/$target.txt" -verbosity=0 || result=1
done
exit $result
