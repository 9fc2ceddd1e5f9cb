# SPDX-License-Identifier: GPL-3.0-or-later
"""Move CTs with axes of many kinds and write fields and images in every format. nibabel, plastimatch and dcmtk read
them: fields are on right-handed grids and have the right directions, and images keep the voxels of the CT.

    test_grid_axes.py SUPINE
"""
import glob
import gzip
import os
import re
import shutil
import subprocess
import sys
import tempfile

try:
    import nibabel
    import numpy
except ImportError:
    print("skipped: this python has no nibabel")
    sys.exit(77)
if not shutil.which("plastimatch") or not shutil.which("dcmdump"):
    print("skipped: plastimatch and dcmtk are not installed")
    sys.exit(77)

supine = sys.argv[1]
faults = []
LPS = numpy.diag([-1.0, -1.0, 1.0])


def run(*words):
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{words}: {done.stderr or done.stdout}")
    return done.stdout


def check(good, what):
    if not good:
        faults.append(what)


def world(matrix, origin, size):
    """Return the places [i, j, k, 3] of the voxels; the columns of `matrix` are the steps."""
    index = numpy.stack(numpy.meshgrid(*[numpy.arange(n) for n in size], indexing="ij"), -1)
    return index @ matrix.T + origin


def pattern(places):
    """A CT that differs from each of its mirror images."""
    x, y, z = numpy.moveaxis(places, -1, 0)
    return -400 + 200 * numpy.sin(x / 21 + y / 60) + 150 * numpy.cos(y / 27 + 1) + 200 * numpy.sin(z / 24 + x / 50 + 2)


def read_field(path):
    """Return the vectors [i, j, k, 3] of a field, its matrix of steps and its origin, LPS, and the header."""
    data = open(path, "rb").read()
    if path.endswith(".nii.gz"):
        image = nibabel.load(path)
        return (numpy.asarray(image.dataobj)[:, :, :, 0], LPS @ image.affine[:3, :3], LPS @ image.affine[:3, 3], {})
    if path.endswith(".nrrd"):
        head, body = data.split(b"\n\n", 1)
        fields = dict(line.split(": ", 1) for line in head.decode().split("\n") if ": " in line)
        steps = numpy.array([[float(x) for x in step.strip("()").split(",")]
                             for step in fields["space directions"].split()[1:]])
        origin = numpy.array([float(x) for x in fields["space origin"].strip("()").split(",")])
        size, body = [int(x) for x in fields["sizes"].split()][1:], gzip.decompress(body)
    else:
        import zlib
        head, body = data.split(b"ElementDataFile = LOCAL\n", 1)
        fields = dict(line.split(" = ", 1) for line in head.decode().split("\n") if " = " in line)
        numbers = {key: numpy.array(fields[key].split(), float)
                   for key in ("TransformMatrix", "ElementSpacing", "Offset")}
        steps = numbers["TransformMatrix"].reshape(3, 3) * numbers["ElementSpacing"][:, None]
        origin, size, body = numbers["Offset"], [int(x) for x in fields["DimSize"].split()], zlib.decompress(body)
    vectors = numpy.frombuffer(body, "<f4").reshape(*size[::-1], 3).transpose(2, 1, 0, 3)
    return vectors, steps.T, origin, fields


def letters(matrix):
    """Name the directions from which the axes come."""
    return "".join(("RL", "AP", "IS")[numpy.abs(column).argmax()][int(column[numpy.abs(column).argmax()] < 0)]
                   for column in matrix.T)


def dicom_numbers(path, tag):
    text = run("dcmdump", "+L", "+P", tag, path)
    return numpy.array(re.search(r"(?:DS \[|F[LD] |OF |UL )([^\]\s]+)", text).group(1).split("\\"), float)


def check_dicom(name, vectors, matrix, origin):
    """Compare the DICOM registration made from the field with it: at every node, the same vector at the same place."""
    run("plastimatch", "convert", "--input", "out.nii.gz", "--output-dicom", "out_dicom", "--patient-name", "Axes")
    run("plastimatch", "convert", "--input", "ct.nii.gz", "--output-dicom", "ct_dicom", "--patient-name", "Axes")
    run("plastimatch", "xf-convert", "--input", "f.mha", "--fixed-rcs", "out_dicom", "--moving-rcs", "ct_dicom",
        "--output-dicom", "reg")
    file, = glob.glob("reg/*.dcm")
    size = dicom_numbers(file, "GridDimensions").astype(int)
    spacing, first = dicom_numbers(file, "GridResolution"), dicom_numbers(file, "ImagePositionPatient")
    rows = dicom_numbers(file, "ImageOrientationPatient").reshape(2, 3)
    steps = numpy.array([*rows, numpy.cross(*rows)]) * spacing[:, None]
    found = dicom_numbers(file, "VectorGridData").reshape(*size[::-1], 3).transpose(2, 1, 0, 3)
    at = (world(steps.T, first, size) - origin) @ numpy.linalg.inv(matrix).T
    near = numpy.rint(at).astype(int)
    check(numpy.abs(at - near).max() < 1e-3 and near.min() >= 0 and (near.max((0, 1, 2)) < vectors.shape[:3]).all(),
          f"{name}: DICOM: nodes elsewhere")
    near = numpy.clip(near, 0, numpy.array(vectors.shape[:3]) - 1)
    off = numpy.abs(found - vectors[near[..., 0], near[..., 1], near[..., 2]]).max()
    check(off < 1e-3, f"{name}: DICOM: vectors differ by {off}")
    check(list(sorted(size)) == list(sorted(vectors.shape[:3])), f"{name}: DICOM: {size} nodes")
    run("plastimatch", "convert", "--input", "out_dicom", "--output-img", "back.nii.gz")
    back = nibabel.load("back.nii.gz")
    check(numpy.linalg.det(back.affine[:3, :3]) > 0, f"{name}: DICOM: the image is left-handed")
    compare_images(f"{name}: DICOM image", back, nibabel.load("out.nii.gz"), 1.5)


def compare_images(name, image, truth, tolerance):
    """Compare two images with nibabel at the voxels of `image`, which are voxels of `truth` too."""
    at = nibabel.affines.apply_affine(numpy.linalg.inv(truth.affine) @ image.affine,
                                      world(numpy.eye(3), numpy.zeros(3), image.shape))
    near = numpy.rint(at).astype(int)
    check(sorted(image.shape) == sorted(truth.shape) and numpy.abs(at - near).max() < 0.05, f"{name}: other voxels")
    near = numpy.clip(near, 0, numpy.array(truth.shape) - 1)
    off = numpy.abs(numpy.asarray(image.dataobj, float) -
                    numpy.asarray(truth.dataobj, float)[near[..., 0], near[..., 1], near[..., 2]])
    check(off.max() <= tolerance, f"{name}: {off.max()} HU off")


def check_warp(name, matrix, field):
    """Move a CT of small voxels, with the given steps, RAS, by the grid of the basis, and by plastimatch with the
    field."""
    steps = matrix / 4
    size = numpy.array([120, 110, 100])
    affine = numpy.eye(4)
    affine[:3, :3] = steps
    affine[:3, 3] = LPS @ numpy.array([0.0, -143.0, -95.0]) - steps @ (size - 1) / 2
    places = world(steps, affine[:3, 3], size)
    nibabel.save(nibabel.Nifti1Image(pattern(places).astype(numpy.int16), affine), "fine.nii.gz")
    run(supine, "deform", "g.safetensors", "--posture", "prone", "--volume", "rest", "--image", "fine.nii.gz", "-o",
        "moved.nii.gz")
    run("plastimatch", "warp", "--input", "fine.nii.gz", "--xf", "f.mha", "--fixed", "moved.nii.gz", "--output-img",
        "warped.nii.gz", "--default-value", "-2000")
    moved, warped = (numpy.asarray(nibabel.load(f"{file}.nii.gz").dataobj, float) for file in ("moved", "warped"))
    vectors, nodes, origin, _ = field
    at = numpy.rint((places @ LPS.T - origin) @ numpy.linalg.inv(nodes).T).astype(int)
    nearest = numpy.moveaxis(numpy.clip(at, 0, numpy.array(vectors.shape[:3]) - 1), -1, 0)
    far = numpy.linalg.norm(vectors[tuple(nearest)], axis=-1) > 5
    off = numpy.percentile(numpy.abs(moved - warped)[far & (warped > -1500)], 95)
    print(f"{name}: plastimatch's image differs by {off:.2f} HU at the 95th percentile of {far.sum()} voxels that "
          f"move by 5 mm")
    check(far.sum() > 10000 and off <= 5, f"{name}: plastimatch's image differs by {off:.1f} HU")


def check_axes(name, matrix):
    """Move a CT whose steps, RAS, are the columns of `matrix`."""
    size = numpy.array([36, 32, 30])
    centre = LPS @ numpy.array([0.0, -143.0, -95.0])
    affine = numpy.eye(4)
    affine[:3, :3] = matrix
    affine[:3, 3] = centre - matrix @ (size - 1) / 2
    ct = pattern(world(matrix, affine[:3, 3], size)).astype(numpy.int16)
    nibabel.save(nibabel.Nifti1Image(ct, affine), "ct.nii.gz")
    shutil.rmtree("out_dicom", ignore_errors=True)
    shutil.rmtree("ct_dicom", ignore_errors=True)
    shutil.rmtree("reg", ignore_errors=True)
    run(supine, "embed", "l.safetensors", "ct.nii.gz", "--grid", "24", "-o", "g.safetensors")
    fields = {}
    for ending in ("nrrd", "mha", "nii.gz"):
        run(supine, "deform", "g.safetensors", "--posture", "prone", "--volume", "rest", "--image", "ct.nii.gz",
            "--inverse", "--field-out", f"f.{ending}", "-o", f"out.{ending}")
        vectors, steps, origin, head = fields[ending] = read_field(f"f.{ending}")
        check(numpy.linalg.det(steps) > 0, f"{name}: f.{ending} is left-handed")
        cosines = steps / numpy.linalg.norm(steps, axis=0)
        check(numpy.abs(cosines.T @ cosines - numpy.eye(3)).max() < 1e-4,
              f"{name}: f.{ending}: axes not at right angles")
        check(ending != "mha" or head["AnatomicalOrientation"] == letters(steps),
              f"{name}: f.mha: {head.get('AnatomicalOrientation')}")
        for number in (0, 1, 2):
            close = numpy.abs(fields[ending][number] - fields["nrrd"][number]).max()
            check(close < 1e-3, f"{name}: f.{ending} differs from f.nrrd by {close}")
    check(numpy.linalg.norm(vectors, axis=-1).max() > 20, f"{name}: nothing moves")
    moved = nibabel.load("out.nii.gz")
    check(moved.shape == ct.shape and numpy.abs(moved.affine - affine).max() < 1e-4,
          f"{name}: out.nii.gz has other voxels")
    motion = numpy.abs(numpy.asarray(moved.dataobj, float) - ct).mean()
    upright = numpy.abs(matrix.T @ matrix - numpy.diag(numpy.diag(matrix.T @ matrix))).max() < 1e-6
    for ending in ("nrrd", "mha", "nii.gz") if upright else ():  # plastimatch reads no other images
        run("plastimatch", "convert", "--input", f"out.{ending}", "--output-img", "back.nii.gz")
        compare_images(f"{name}: out.{ending}", nibabel.load("back.nii.gz"), moved, 0)
        run("plastimatch", "warp", "--input", "ct.nii.gz", "--xf", f"f.{ending}", "--fixed", "out.nii.gz",
            "--output-img", "warped.nii.gz", "--default-value", "-2000")
        warped = numpy.asarray(nibabel.load("warped.nii.gz").dataobj, float)
        shown = warped > -1500  # where the tissue comes from inside the CT
        off = numpy.abs(warped - numpy.asarray(moved.dataobj, float))[shown].mean()
        print(f"{name}: f.{ending}: plastimatch's image differs by {off:.2f} HU, the motion changes it by "
              f"{motion:.1f} HU")
        check(shown.mean() > 0.3 and off < 0.02 * motion, f"{name}: f.{ending}: plastimatch moves the CT otherwise")
    check_warp(name, matrix if upright else LPS @ low, fields["mha"])
    if upright:
        run("plastimatch", "convert", "--input", "out.nii.gz", "--output-img", "named.mha")
        named = re.search(rb"AnatomicalOrientation = (\w+)", open("named.mha", "rb").read(2000)).group(1)
        own = re.search(rb"AnatomicalOrientation = (\w+)", open("out.mha", "rb").read(2000)).group(1)
        check(named == own, f"{name}: out.mha is {own}, plastimatch says {named}")
        check_dicom(name, *fields["mha"][:3])


folder = tempfile.mkdtemp()
os.chdir(folder)
run(supine, "phantom", "--vertices", "1500", "-o", "p.ply")
run(supine, "precompute", "p.ply", "--held-out", "20", "-o", "l.safetensors")
low, degrees = numpy.diag([8.0, 9.0, 10.0]), numpy.pi / 180
turn = numpy.array([[numpy.cos(12 * degrees), -numpy.sin(12 * degrees), 0],
                    [numpy.sin(12 * degrees), numpy.cos(12 * degrees), 0], [0, 0, 1]])
lean = numpy.array([[1, 0, 0], [0, 1, numpy.tan(15 * degrees)], [0, 0, 1.0]])
for title, axes in (("L-A-S", numpy.diag([-1.0, 1, 1])), ("R-A-S", numpy.eye(3)), ("L-P-S", LPS), ("oblique", turn),
                    ("oblique, left-handed", turn @ numpy.diag([-1.0, 1, 1])),
                    ("sagittal", numpy.array([[0, 0, 1.0], [-1, 0, 0], [0, 1, 0]])),
                    ("tilted", lean), ("tilted, left-handed", lean @ numpy.diag([-1.0, 1, 1]))):
    check_axes(title, axes @ low)
os.chdir("/")
shutil.rmtree(folder)
for fault in faults:
    print(fault)
print(f"{len(faults)} faults")
sys.exit(1 if faults else 0)
