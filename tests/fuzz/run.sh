#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Fuzz every reader with libFuzzer for a given time.
#
#     tests/fuzz/run.sh [SECONDS] [FOLDER]       3600 s per reader and build/fuzz by default
#
# Needs clang and its runtime (libclang-rt-14-dev in Debian 12). Inputs that fail are saved in
# FOLDER as crash-*, slow-unit-* or oom-*. Inputs that reach new code are saved in FOLDER/corpus for the next run.
set -e
seconds=${1:-3600}
source=$(cd "$(dirname "$0")/../.." && pwd)
folder=${2:-$source/build/fuzz}
cmake -S "$source" -B "$folder" -G Ninja -DCMAKE_C_COMPILER=clang -DCMAKE_BUILD_TYPE=RelWithDebInfo \
  -DSUPINE_FUZZ=ON -DSUPINE_SANITIZE=address,undefined > "$folder.log" 2>&1
targets=""
readers="ply stl vtp obj nrrd nii mha points_csv points_json message text basis numbers"
for reader in $readers; do
  targets="$targets fuzz_$reader libfuzzer_$reader"
done
cmake --build "$folder" --target $targets >> "$folder.log" 2>&1
cd "$folder"
export LSAN_OPTIONS="suppressions=$source/tests/lsan.supp:print_suppressions=0"
failed=0
for reader in $readers; do
  case $reader in ply | stl | vtp | obj) dictionary=mesh ;; nrrd | nii | mha) dictionary=image ;; message | points_*) dictionary=text ;; numbers) dictionary=basis ;; *) dictionary=$reader ;; esac
  mkdir -p "corpus/$reader"
  "tests/fuzz/fuzz_$reader" -seeds "corpus/$reader" > /dev/null
  if "tests/fuzz/libfuzzer_$reader" -dict="$source/tests/fuzz/$dictionary.dict" -max_total_time="$seconds" \
    -timeout=10 -rss_limit_mb=2048 -max_len=16384 -print_final_stats=1 "corpus/$reader" > "$reader.log" 2>&1; then
    verdict="no failure"
  else
    verdict="FAILED: see $folder/$reader.log"
    failed=1
  fi
  echo "$reader: $(sed -n 's/^stat::number_of_executed_units: *//p' "$reader.log") inputs, $verdict"
done
exit $failed
