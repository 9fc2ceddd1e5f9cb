#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Run the BIDS app on four subjects, one of whom has a corrupt file and one no lungs:
# test_bids.sh PROGRAM COHORT
set -u
SUPINE=$1
export SUPINE
cohort=$2
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
for i in 01 02 03; do
  mkdir -p "data/sub-$i/anat"
  "$SUPINE" phantom --vertices 300 -o "data/sub-$i/anat/sub-${i}_desc-lungs_mesh.ply" >/dev/null || exit 1
done
head -c 3000 data/sub-03/anat/*.ply >cut && mv cut data/sub-03/anat/sub-03_desc-lungs_mesh.ply
mkdir data/sub-04

python3 "$cohort/bids.py" data out group >said 2>&1 && fail "the group level succeeds without participants"
grep -q "run the level 'participant' first" said || fail "$(cat said)"
python3 "$cohort/bids.py" data out participant --participant_label 02 -- --band 2 >said 2>&1 ||
  fail "one participant: $(cat said)"
[ "$(ls out)" = "dataset_description.json
sub-02" ] || fail "one participant left $(ls out)"
python3 "$cohort/bids.py" data out participant --participant_label ../data/sub-02 >said 2>&1 && fail "a label leaves its folder"
grep -q "cannot be the name of a subject" said || fail "$(cat said)"
python3 "$cohort/bids.py" data out participant -- --band 2 >said 2>&1 || fail "participants: $(cat said)"
python3 "$cohort/bids.py" data out group >said 2>&1 || fail "group: $(cat said)"
for i in 01 02; do
  [ -s "out/sub-$i/basis.safetensors" ] && [ -s "out/sub-$i/report.html" ] || fail "sub-$i: $(ls "out/sub-$i")"
done
grep -q '<h1>4 subjects: 2 done, 2 failed</h1>' out/group.html || fail "$(grep '<h1>' out/group.html)"
grep -q '"DatasetType": "derivative"' out/dataset_description.json || fail "no description"
[ $failures -eq 0 ] || exit 1
