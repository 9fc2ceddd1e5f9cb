#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""BIDS App: make a basis and a comparison for each subject of a dataset, and one page of all subjects.

    bids.py BIDS_DIR OUTPUT_DIR participant [--participant_label LABEL...] [-- PRECOMPUTE OPTIONS]
    bids.py BIDS_DIR OUTPUT_DIR group

The lungs of a subject may be anywhere in its folder sub-LABEL: label maps (*_dseg.nii.gz), or else masks
(*_mask.nii.gz), or else surfaces (*_mesh.ply, .stl, .obj, .off). All files of a subject make one model. For each
subject, write sub-LABEL/basis.safetensors, report.html and result.json. A subject that fails is named on the page
of the group and does not stop the others. The program is $SUPINE (default: supine)."""
import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

from names import fault

HERE = Path(__file__).resolve().parent
KINDS = (("*_dseg.nii.gz", "*_dseg.nii"), ("*_mask.nii.gz", "*_mask.nii"),
         ("*_mesh.ply", "*_mesh.stl", "*_mesh.obj", "*_mesh.off"))


def lungs_of(folder):
    for patterns in KINDS:
        found = sorted(str(path) for pattern in patterns for path in folder.rglob(pattern))
        if found:
            return found
    return []


def describe(output):
    """Write dataset_description.json, which BIDS requires of a derivative dataset."""
    output.mkdir(parents=True, exist_ok=True)
    program = os.environ.get("SUPINE", "supine")
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    (output / "dataset_description.json").write_text(json.dumps({
        "Name": "Lungs that deform with gravity", "BIDSVersion": "1.8.0",
        "DatasetType": "derivative",
        "GeneratedBy": [{"Name": "supine", "Version": said.split()[-1]}]}, indent=1) + "\n",
        encoding="utf-8")


def participant(dataset, output, labels, options):
    for label in labels:
        if fault(label):
            sys.exit(fault(label))
    folders = [dataset / f"sub-{label}" for label in labels] if labels else sorted(
        path for path in dataset.glob("sub-*") if path.is_dir())
    if not folders:
        sys.exit(f"{dataset}: it has no folder sub-*")
    for folder in folders:
        # If there are no lungs, name a file that does not exist, so that the failure in result.json names it.
        meshes = lungs_of(folder) or [str(folder / "*_dseg.nii.gz")]
        subprocess.run([sys.executable, HERE / "subject.py", output / folder.name / "result.json",
                        "rest", "yes", " ".join(options), *meshes], check=True)


def group(output):
    results = sorted(output.glob("sub-*/result.json"))
    if not results:
        sys.exit(f"{output}: no sub-*/result.json: run the level 'participant' first")
    subprocess.run([sys.executable, HERE / "group.py", output / "group.csv", output / "group.html",
                    *results], check=True)


def main():
    arguments = sys.argv[1:]
    options = []
    if "--" in arguments:
        at = arguments.index("--")
        arguments, options = arguments[:at], arguments[at + 1:]
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bids_dir", type=Path)
    parser.add_argument("output_dir", type=Path)
    parser.add_argument("analysis_level", choices=("participant", "group"))
    parser.add_argument("--participant_label", "--participant-label", nargs="+", default=[])
    wanted = parser.parse_args(arguments)
    describe(wanted.output_dir)
    if wanted.analysis_level == "participant":
        labels = [label.removeprefix("sub-") for label in wanted.participant_label]
        participant(wanted.bids_dir, wanted.output_dir, labels, options)
    else:
        group(wanted.output_dir)


if __name__ == "__main__":
    main()
