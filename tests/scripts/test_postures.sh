#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Refuse what cannot become an archive of DICOM series, and leave nothing behind; the guide's page on DICOM runs the rest:
# test_postures.sh PROGRAM COHORT
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
# refused WORDS SAID: the command with WORDS ends with an error that has SAID, and changes nothing.
refused() {
  before=$(ls)
  # shellcheck disable=SC2086
  /usr/bin/python3 "$cohort/postures.py" $1 >said 2>&1 && echo "FAILED: $1: accepted" && failures=$((failures + 1))
  grep -q "$2" said && [ "$(ls)" = "$before" ] && return
  echo "FAILED: $1: $(cat said; ls)"
  failures=$((failures + 1))
}
refused "grid ct.nii.gz terms taken" "taken: name a new folder"
refused "grid ct.nii.gz terms none/new" "none/new: name a new folder, in one that exists"
refused "grid ct.nii.gz absent new" "absent: no such file; an archive needs the terms"
refused "absent.safetensors ct.nii.gz terms new" "absent.safetensors: "
refused "terms ct.nii.gz terms new" "terms: "
[ $failures -eq 0 ]
