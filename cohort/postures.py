#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write one person's CT in several postures as DICOM series, in a folder ready for an archive.

    python3 postures.py GRID CT LICENCE FOLDER [--volume VOLUME] [--patient NAME]

GRID is a basis that 'supine embed --grid' made for CT, and LICENCE a file with the terms under which the CT may be
passed on. FOLDER, which must not exist, gets a folder for each series, series.csv, README.txt, LICENCE and the
checksums of all of them (sha256sum -c SHA256SUMS). The program is $SUPINE (default: supine). Also needed: plastimatch,
nibabel and pydicom (Debian: plastimatch python3-nibabel python3-pydicom).

Images are stored as a scanner stores them: gravity points to their lower edge, and slices are counted into the gantry.
Their rows and columns therefore have other directions in the body in each posture, head first and feet first."""
import argparse
import csv
import hashlib
import os
import shutil
import sys
import tempfile
from pathlib import Path

from whole import check_new, new_folder, run

try:
    import nibabel
    import numpy as np
    from nibabel import orientations
    from pydicom import dcmread
    from pydicom.dataset import Dataset
    from pydicom.uid import generate_uid
except ImportError as error:
    sys.exit(f"{error}: apt-get install python3-nibabel python3-pydicom, and run this with /usr/bin/python3")

# posture: what DICOM calls it after HF (head first) or FF (feet first), and the side of the body at the lower edge of
# the image, in LPS. DICOM has no such name for a person who stands.
POSTURES = {"supine": ("S", (0, 1, 0)), "prone": ("P", (0, -1, 0)), "left": ("DL", (1, 0, 0)),
            "right": ("DR", (-1, 0, 0)), "upright": (None, (0, 1, 0))}
# meaning: code and scheme, from DICOM PS3.16, CID 19 to 21
CODES = {"erect": ("C86043", "NCIt"), "standing": ("10904000", "SCT"), "headfirst": ("102540008", "SCT")}
ABOUT = """CT of one person in {postures} postures, as {series} DICOM series

These images were computed. One scan was moved by a model of how lungs deform with gravity ({version}); what lies
around the lungs stays as in the scan. Where the tissue truly is in other postures was not measured. Not for diagnosis
or treatment.

Each series has its own frame of reference, whose coordinates are those of the scan's body. All series belong to one
study and one patient. series.csv lists them; LICENCE has the terms. What the program printed about each posture:

{printed}"""


def turned(image, below, into):
    """Return an image whose columns go to the side `below` (LPS) and whose slices are counted towards `into`."""
    rows = np.cross(below, into)
    axes = np.array([rows, below, into]) * [-1, -1, 1]  # LPS to nibabel's RAS
    wanted = [(np.abs(axis).argmax(), axis.sum()) for axis in axes]
    return image.as_reoriented(orientations.ornt_transform(orientations.io_orientation(image.affine), wanted))


def code(meaning):
    item = Dataset()
    item.CodeValue, item.CodingSchemeDesignator = CODES[meaning]
    item.CodeMeaning = meaning
    return item


def describe(path, number, title, position, uids, patient):
    """Complete a slice that plastimatch wrote: whose it is, how the person lies, and that it is computed."""
    image = dcmread(path)
    image.PatientName = patient
    image.PatientID = patient
    image.StudyInstanceUID, image.FrameOfReferenceUID = uids
    image.BodyPartExamined = "CHEST"
    image.SeriesNumber = number
    image.SeriesDescription = f"{title} (predicted)"
    image.ImageComments = "Computed from a scan in another posture by a model of lungs. Not for diagnosis or treatment."
    if position:
        image.PatientPosition = position
    else:
        del image.PatientPosition
        standing = code("erect")
        standing.PatientOrientationModifierCodeSequence = [code("standing")]
        image.PatientOrientationCodeSequence = [standing]
        image.PatientGantryRelationshipCodeSequence = [code("headfirst")]
    image.save_as(path)
    return image


def write_series(folder, moved, posture, first, number, study, patient):
    """Write the series of a posture, head first or feet first, and return its row of series.csv."""
    short, below = POSTURES[posture]
    position = f"{first}{short}" if short else ""
    name = position or posture
    turned_path = folder / "turned.nii.gz"
    nibabel.save(turned(moved, below, (0, 0, 1 if first == "HF" else -1)), turned_path)
    run("plastimatch", "convert", "--input", turned_path, "--output-dicom", folder / name, "--filenames-without-uids")
    turned_path.unlink()
    title = f"{posture}, {'head' if first == 'HF' else 'feet'} first"
    uids = (study, generate_uid())
    slices = [describe(path, number, title, position, uids, patient) for path in sorted((folder / name).glob("*.dcm"))]
    return {"series": name, "posture": posture, "patient_position": position, "slices": len(slices),
            "image_orientation": " ".join(f"{x + 0.0:g}" for x in slices[0].ImageOrientationPatient),  # + 0.0: no "-0"
            "series_uid": slices[0].SeriesInstanceUID, "frame_of_reference_uid": uids[1]}


def fill(folder, wanted, program):
    """Write all that the archive gets, but for the checksums."""
    with tempfile.TemporaryDirectory(dir=folder.parent) as work:
        listed = Path(work, "states.csv")
        listed.write_text("posture,volume,output\n" + "".join(
            f"{posture},{wanted.volume},{posture}.nii.gz\n" for posture in POSTURES), encoding="utf-8")
        printed = run(program, "deform", wanted.grid, "--states", listed, "--image", wanted.ct, "--density")
        study = generate_uid()
        rows = []
        for posture, (short, _) in POSTURES.items():
            moved = nibabel.load(Path(work, f"{posture}.nii.gz"))
            for first in ("HF", "FF") if short else ("HF",):
                rows.append(write_series(folder, moved, posture, first, len(rows) + 1, study, wanted.patient))
                print(f"{rows[-1]['series']}: {rows[-1]['slices']} slices", flush=True)
    with open(folder / "series.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        table.writerows(rows)
    shutil.copyfile(wanted.licence, folder / "LICENCE")
    (folder / "README.txt").write_text(ABOUT.format(
        postures=len(POSTURES), series=len(rows), version=run(program, "--version").strip(),
        printed=printed.replace(work + os.sep, "")), encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("grid", "ct", "licence", "folder"):
        parser.add_argument(name, type=Path, metavar=name.upper())
    parser.add_argument("--volume", default="rest", help="volume of the lungs in all postures (default: rest)")
    parser.add_argument("--patient", default="Synthetic^Lungs", help="name and identifier of the patient in DICOM")
    wanted = parser.parse_args()
    check_new(wanted.folder)
    if not wanted.licence.is_file():
        sys.exit(f"{wanted.licence}: no such file; an archive needs the terms under which the CT may be passed on")
    if shutil.which("plastimatch") is None:
        sys.exit("plastimatch is missing, which writes DICOM: apt-get install plastimatch")
    with new_folder(wanted.folder) as folder:
        fill(folder, wanted, os.environ.get("SUPINE", "supine"))
        sums = "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(folder)}\n"
                       for path in sorted(folder.rglob("*")) if path.is_file())
        (folder / "SHA256SUMS").write_text(sums, encoding="utf-8")


if __name__ == "__main__":
    main()
