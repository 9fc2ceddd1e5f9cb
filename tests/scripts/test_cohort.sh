#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Run the cohort workflow on forty synthetic subjects, three of whom have missing or corrupt files:
#
#     test_cohort.sh PROGRAM COHORT [OPTIONS OF SNAKEMAKE]
#
# The default options are --cores 2. On a cluster, use --slurm --jobs 2.
set -u
supine=$1
cohort=$2
shift 2
[ $# -gt 0 ] || set -- --cores 2
command -v snakemake >/dev/null || { echo "skipped: snakemake is not installed"; exit 77; }
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
export HOME="$work" # where snakemake keeps its cache
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
mkdir meshes
echo subject,meshes,options >subjects.csv
for i in $(seq -w 1 40); do
  volume=$((2000 + ${i#0} * 37 % 900))
  [ "$i" = 17 ] && volume=9000
  "$supine" phantom --vertices 300 --volume "${volume}mL" -o "meshes/$i.ply" >/dev/null || exit 1
  echo "sub-$i,meshes/$i.ply,--band 2" >>subjects.csv
done
rm meshes/05.ply
head -c 3000 meshes/11.ply >cut && mv cut meshes/11.ply
printf 'v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 250\nf 1 3 2\nf 1 2 4\nf 2 3 4\n' >meshes/23.obj
sed -i 's/23.ply/23.obj/' subjects.csv # an open surface instead of a closed one

flow() {
  snakemake -s "$cohort/Snakefile" --nocolor "$@" --config table=subjects.csv out=results \
    supine="$supine" report=no >said 2>&1
}
flow "$@" || fail "the first run: $(tail -5 said)"
[ "$(tr -d '\r' <results/group.csv | grep -c '^sub-')" -eq 40 ] || fail "rows: $(wc -l <results/group.csv)"
[ "$(ls results/*/basis.safetensors | wc -l)" -ge 37 ] || fail "bases: $(ls results/*/basis.safetensors | wc -l)"
grep -q '<h1>40 subjects: 37 done, 3 failed</h1>' results/group.html || fail "$(grep '<h1>' results/group.html)"
for failed in 'sub-05.*05.ply' 'sub-11.*11.ply' 'sub-23.*volume'; do
  grep -q "^$failed" results/group.csv || fail "no failure like $failed: $(grep "${failed%%.*}" results/group.csv)"
done
tr -d '\r' <results/group.csv | grep '^sub-17' | grep -q 'left_lung_ml' || fail "sub-17 is not reported as an outlier"
flow "$@" || fail "the second run"
grep -q 'Nothing to be done' said || fail "the second run computed something: $(cat said)"
cp results/sub-08/result.json before.json
"$supine" phantom --vertices 300 --volume 2222mL -o meshes/07.ply >/dev/null
flow "$@" || fail "the third run"
grep -q '^subject *1' said || fail "one changed input recomputed: $(grep -A6 '^job' said)"
cmp -s before.json results/sub-08/result.json || fail "another subject was computed again"
rm -r results/sub-09
flow "$@" || fail "the fourth run"
grep -q '^subject *1' said || fail "one missing result recomputed: $(grep -A6 '^job' said)"
# A name never leaves the folder of the results, and may have signs of regular expressions.
for wrong in ../evil a/b .. group.csv 'a{b}'; do
  printf 'subject,meshes,options\n%s,meshes/01.ply,--band 2\n' "$wrong" >subjects.csv
  flow "$@" && fail "the name $wrong is not refused"
  grep -q "cannot be the name of a subject" said || fail "$wrong: $(cat said)"
  [ ! -e evil ] && [ ! -e results/b ] || fail "$wrong left its folder"
done
printf 'subject,meshes,options\na+b (1),meshes/01.ply,--band 2\n' >subjects.csv
flow "$@" || fail "a+b: $(tail -5 said)"
[ -s "results/a+b (1)/basis.safetensors" ] || fail "no results of a+b: $(ls results)"
[ $failures -eq 0 ] || exit 1
