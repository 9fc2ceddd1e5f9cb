#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Refuse what cannot become an archive of DICOM series or a sum of doses, and leave nothing behind. The guide's pages on
# DICOM and on dose run what succeeds: test_cohort_refused.sh PROGRAM COHORT
set -u
SUPINE=$1
export SUPINE
cohort=$2
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
/usr/bin/python3 "$cohort/postures.py" --help >said 2>&1 || {
  cat said
  exit 77
}
command -v plastimatch >/dev/null || exit 77
failures=0
echo "terms" >terms
mkdir taken
# refused COMMAND SAID: the command ends with an error that has SAID, and changes nothing.
refused() {
  before=$(ls)
  # shellcheck disable=SC2086
  /usr/bin/python3 "$cohort"/$1 >said 2>&1 && echo "FAILED: $1: accepted" && failures=$((failures + 1))
  grep -q "$2" said && [ "$(ls)" = "$before" ] && return
  echo "FAILED: $1: $(cat said; ls)"
  failures=$((failures + 1))
}
refused "postures.py grid ct.nii.gz terms taken" "taken: name a new folder"
refused "postures.py grid ct.nii.gz terms none/new" "none/new: name a new folder, in one that exists"
refused "postures.py grid ct.nii.gz absent new" "absent: no such file; an archive needs the terms"
refused "subject.py results/../evil/result.json rest no  lungs.ply" "name the subject by letters"
refused "postures.py absent.safetensors ct.nii.gz terms new" "absent.safetensors: "
refused "postures.py terms ct.nii.gz terms new" "terms: "
echo "posture,volume,weight
supine,rest,0.5
prone,rest,0.4" >states
refused "dose.py grid ct.nii.gz states taken --dose dose.nii.gz" "taken: name a new folder"
refused "dose.py grid ct.nii.gz absent new --dose dose.nii.gz" "absent: no such file"
refused "dose.py grid ct.nii.gz states new" "states:2: give a posture, and a dose"
refused "dose.py grid ct.nii.gz states new --dose dose.nii.gz" "states: the weights sum to 0.9"
echo "posture,volume,weight
supine,rest,half" >states
refused "dose.py grid ct.nii.gz states new --dose dose.nii.gz" "states:2: weight 'half'"
# An image of nothing inside the lungs: a dose in another frame, one below 0, and one that is no image.
"$SUPINE" phantom --vertices 500 -o lungs.ply >/dev/null && "$SUPINE" precompute lungs.ply -o basis >/dev/null &&
  /usr/bin/python3 - <<'CODE' && "$SUPINE" embed basis ct.nii.gz --grid 20 -o grid >/dev/null || exit 1
import nibabel
import numpy as np
affine = np.array([[-10.0, 0, 0, 200], [0, -10, 0, 300], [0, 0, 10, -300], [0, 0, 0, 1]])
ct = np.full((40, 40, 40), -850, np.int16)
away = affine.copy()
away[0, 3] += 400
for name, values, frame in (("ct", ct, affine), ("away", 0 * ct, away), ("below", 0 * ct - 1, affine)):
    nibabel.save(nibabel.Nifti1Image(values, frame), f"{name}.nii.gz")
CODE
echo "posture,volume
supine,rest" >states
refused "dose.py grid ct.nii.gz states new --dose away.nii.gz" "away.nii.gz: [0-9]* % of the lungs lie outside it"
refused "dose.py grid ct.nii.gz states new --dose below.nii.gz" "below.nii.gz: a dose is one number a voxel"
refused "dose.py grid ct.nii.gz states new --dose terms" "terms: "
[ $failures -eq 0 ]
