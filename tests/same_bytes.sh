#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Check that commands write the same bytes with 1, 2, 3 and 7 threads, and compare the outputs of several builds.
#
#     tests/same_bytes.sh build/release/supine [build/debug/supine ...]
#
# The first build makes the input files. Then each build runs each command with each number of threads. Exit with 1 if
# an output depends on the number of threads. Print which outputs differ between builds.
set -eu
export SOURCE_DATE_EPOCH=0
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
first=$(realpath "$1")
for program in "$@"; do
  programs="${programs-} $(realpath "$program")"
done
cd "$work"
"$first" phantom --vertices 9000 -o lungs.ply >/dev/null
"$first" precompute lungs.ply --band 5 -o lungs.safetensors >/dev/null
printf 'name,x,y,z\na,60,-150,-100\nb,-70,-120,-90\n' >points.csv
"$first" embed lungs.safetensors points.csv -o points.safetensors >/dev/null 2>&1

failed=0
# compare ENDING COMMAND...: run the command in every build with every number of threads. Check that all files with this
# ending are equal.
compare() {
  ending=$1
  shift
  sums=""
  for program in $programs; do
    each=""
    for threads in 1 2 3 7; do
      SUPINE_THREADS=$threads "$program" "$@" -o "out.$ending" >log 2>&1 || { cat log; exit 1; }
      each="$each $(sha256sum <"out.$ending" | cut -c1-16)"
      rm "out.$ending"
    done
    # shellcheck disable=SC2086
    if [ "$(printf '%s\n' $each | sort -u | wc -l)" -ne 1 ]; then
      echo "$1 .$ending: depends on the number of threads in $program:$each"
      failed=1
    fi
    sums="$sums ${each##* }"
  done
  # shellcheck disable=SC2086
  case $(printf '%s\n' $sums | sort -u | wc -l) in
  1) echo "$1 .$ending: same bytes in all builds" ;;
  *) echo "$1 .$ending: differs between builds" ;;
  esac
}
compare ply phantom --vertices 9000
compare safetensors precompute lungs.ply --band 5
compare safetensors precompute lungs.ply --band 3 --soften 1
compare ply solve lungs.ply --posture left
compare ply deform lungs.safetensors --posture prone
compare vtp deform lungs.safetensors --posture prone
compare html compare lungs.safetensors --postures supine,prone
compare png render lungs.safetensors --posture supine
compare html export lungs.safetensors
compare glb export lungs.safetensors
compare vtp breathe lungs.safetensors --posture prone
compare safetensors embed lungs.safetensors points.csv
compare csv deform points.safetensors --posture prone
exit $failed
