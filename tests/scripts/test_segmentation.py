# SPDX-License-Identifier: GPL-3.0-or-later
"""Test that `supine precompute` reads DICOM segmentations: pydicom writes the lobes of real lungs, and the surfaces
equal those of the same labels in NIfTI, whose volumes nibabel gives. Other objects are refused with a remedy.

    test_segmentation.py SUPINE EXAMPLES_FOLDER GUIDE_FOLDER

Exit with 77 if pydicom, nibabel or dcm2json is missing."""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
try:
    import nibabel
    import numpy as np
    from helpers.segmentation import CT, RTSTRUCT, write
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)
if shutil.which("dcm2json") is None:
    print("skipped: dcm2json (dcmtk) is missing")
    sys.exit(77)

supine, lungs, guide = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
# Segments: the file of a lobe, its code in SNOMED CT with the side in a modifier, as TotalSegmentator and 3D Slicer
# write it (DICOM CID 7155), and the code that has the side in it.
LEFT, RIGHT = "7771000", "24028007"
LOBES = {"lung_upper_lobe_left": ("45653009", LEFT, "44714003"),
         "lung_lower_lobe_left": ("90572001", LEFT, "41224006"),
         "lung_upper_lobe_right": ("45653009", RIGHT, "42400003"),
         "lung_middle_lobe_right": ("40020002", "", "72481006"),
         "lung_lower_lobe_right": ("90572001", RIGHT, "266005")}
NUMBERS = {name: number for number, name in enumerate(LOBES, 3)}


def run(*arguments):
    done = subprocess.run([supine, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          check=False)
    return done.returncode, done.stdout


def surfaces(source, *options):
    code, said = run("precompute", source, *options, "-o", "made.safetensors", "--surfaces-out", "made.ply",
                     "--band", "2", "--held-out", "20", "--scanned", "full", "--edge", "12")
    assert code == 0, (source, said)
    header, content = pathlib.Path("made.ply").read_bytes().split(b"end_header\n", 1)
    count = int(header.split(b"element vertex ")[1].split(b"\n")[0])
    return np.frombuffer(content, "<f4", 3 * count), content[12 * count:], said


def refused(code, words, source, *options):
    found, said = run("precompute", source, *options, "-o", "none.safetensors")
    assert found == code and words in said, (source, found, said)
    assert not os.path.exists("none.safetensors")


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    subprocess.run([sys.executable, guide / "synthetic_ct.py", lungs / "left.obj", lungs / "right.obj"], check=True,
                   stdout=subprocess.DEVNULL)
    images = {name: nibabel.load(f"segmentation/{name}.nii.gz") for name in LOBES}
    affine = next(iter(images.values())).affine
    codes = {NUMBERS[name]: (code, side) for name, (code, side, _) in LOBES.items()}
    sided = {NUMBERS[name]: (code, "") for name, (_, _, code) in LOBES.items()}
    labels = np.zeros(next(iter(images.values())).shape, np.uint8)
    for name, image in images.items():  # the lungs overlap a little
        labels[np.asarray(image.dataobj) > 0] = NUMBERS[name]
    masks = {number: labels == number for number in codes}
    nibabel.save(nibabel.Nifti1Image(labels, affine), "labels.nii.gz")
    liver = np.zeros_like(labels, bool)
    liver[5:9, 5:9, :] = labels[5:9, 5:9, :] == 0
    everything = {1: np.ones_like(liver), 2: liver, **masks}  # the body overlaps all others

    expected, triangles, said = surfaces("labels.nii.gz", "--labels", "left=3+4,right=5+6+7")
    volume = {side: sum(masks[n].sum() for n in numbers) * abs(np.linalg.det(affine)) / 1000
              for side, numbers in (("left", (3, 4)), ("right", (5, 6, 7)))}
    write("binary.dcm", everything, codes, affine)
    write("fractional.dcm", masks, sided, affine, fractional=True)
    write("uncoded.dcm", masks, {}, affine)
    for source, options in (("binary.dcm", ()), ("fractional.dcm", ()),
                            ("uncoded.dcm", ("--labels", "left=3+4,right=5+6+7"))):
        found, corners, said = surfaces(source, *options)
        assert corners == triangles and np.abs(found - expected).max() < 1e-3, source  # NIfTI's header has float32
        assert "border" not in said, said  # the first and the last slice of `masks` are full of lung
        for side, value in volume.items():
            assert f"{side} lung: {value:.1f} mL" in said, (side, value, said)

    refused(2, "which of its labels", "uncoded.dcm")
    write("liver.dcm", {1: liver}, {}, affine)
    refused(2, "which of its labels (1) are lungs", "liver.dcm")
    write("overlap.dcm", {1: masks[3], 2: masks[3] | masks[4]}, {}, affine)
    refused(3, "overlap in frame", "overlap.dcm")
    write("shifted.dcm", masks, codes, affine, shift=1.0)
    refused(3, "beside the grid of the others", "shifted.dcm")
    write("contours.dcm", {1: liver}, {}, affine, kind=RTSTRUCT)
    refused(3, "RTSTRUCT", "contours.dcm")
    write("ct.dcm", {1: liver}, {}, affine, kind=CT)
    refused(3, "no DICOM segmentation", "ct.dcm")
    content = pathlib.Path("binary.dcm").read_bytes()
    for size in (0, 200, len(content) // 2):
        pathlib.Path("cut.dcm").write_bytes(content[:size])
        refused(2, "cut.dcm", "cut.dcm")
    refused(2, "absent.dcm", "absent.dcm")
    os.environ["PATH"] = "/nowhere"
    refused(3, "dcm2json, which is missing", "binary.dcm")
print("segmentations are read")
