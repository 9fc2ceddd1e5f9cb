# SPDX-License-Identifier: GPL-3.0-or-later
"""Exchange displacement fields, images and surfaces with nibabel, plastimatch, transformix and VTK.

    test_foreign_tools.py SUPINE
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile

try:
    import nibabel
    import numpy
except ImportError:
    print("skipped: this python has no nibabel")
    sys.exit(77)

supine = sys.argv[1]
faults = []


def run(*arguments):
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        faults.append(f"{arguments}: {done.stderr or done.stdout}")
    return done.stdout + done.stderr


def read_nrrd(path):
    """Return the vectors [k, j, i, 3] of a displacement field, and its origin."""
    import gzip
    data = open(path, "rb").read()
    head, body = data.split(b"\n\n", 1)
    fields = dict(line.split(": ", 1) for line in head.decode().split("\n") if ": " in line)
    sizes = [int(x) for x in fields["sizes"].split()]
    origin = [float(x) for x in fields["space origin"].strip("()").split(",")]
    body = gzip.decompress(body) if fields["encoding"].startswith("gz") else body
    return numpy.frombuffer(body, "<f4").reshape(sizes[::-1]).astype(float), numpy.array(origin)


def close(name, a, b, tolerance):
    if not numpy.abs(numpy.asarray(a) - numpy.asarray(b)).max() <= tolerance:
        faults.append(f"{name}: {numpy.abs(numpy.asarray(a) - numpy.asarray(b)).max()} too far")


def plastimatch_stats(path):
    """Return the minimum, the mean and the maximum (three rows) of the x, y and z components (three columns)."""
    text = run("plastimatch", "stats", path)
    return numpy.array([[float(x) for x in re.search(rf"{word}:\s+(\S+)\s+(\S+)\s+(\S+)", text).groups()]
                        if re.search(rf"{word}:\s+(\S+)\s+(\S+)\s+(\S+)", text) else [numpy.nan] * 3
                        for word in ("Min", "Mean", "Max")])


folder = tempfile.mkdtemp()
os.chdir(folder)
run(supine, "phantom", "--vertices", "1500", "-o", "p.ply")
run(supine, "precompute", "p.ply", "--held-out", "20", "-o", "l.safetensors")
run(supine, "embed", "l.safetensors", "--grid", "10", "-o", "g.safetensors")
for ending in ("nrrd", "nii.gz", "mha"):
    run(supine, "deform", "g.safetensors", "--posture", "prone", "--volume", "rest", "--field-out", f"f.{ending}")
run(supine, "embed", "l.safetensors", "--grid", "12", "-o", "coarse.safetensors")
run(supine, "deform", "coarse.safetensors", "--from", "supine:rest", "--posture", "left", "--volume", "full",
    "--field-out", "coarse.nrrd")
for name in ("coarse.nrrd", "f.nrrd"):
    vectors, origin = read_nrrd(name)
    border = max(numpy.abs(numpy.take(vectors, end, axis)).max() for axis in range(3) for end in (0, -1))
    if border != 0 or numpy.abs(vectors).max() < 20:
        faults.append(f"{name}: {border} mm at the border of the grid, {numpy.abs(vectors).max()} mm at most")

if faults:
    sys.exit("\n".join(faults))
image = nibabel.load("f.nii.gz")
close("nibabel: vectors", numpy.asarray(image.dataobj)[:, :, :, 0].transpose(2, 1, 0, 3), vectors, 1e-6)
close("nibabel: place", image.affine[:3, 3] * [-1, -1, 1], origin, 1e-3)
if image.header.get_intent()[0] != "vector":
    faults.append(f"nibabel: intent {image.header.get_intent()}")

if shutil.which("plastimatch"):
    wanted = numpy.stack([vectors.reshape(-1, 3).min(0), vectors.reshape(-1, 3).mean(0), vectors.reshape(-1, 3).max(0)])
    for ending in ("nrrd", "nii.gz", "mha"):
        close(f"plastimatch: f.{ending}", plastimatch_stats(f"f.{ending}"), wanted, 2e-3)

# Images are warped by supine. plastimatch converts a warped .mha image, which nibabel then reads.
size = (40, 36, 38)
grid = numpy.indices(size).sum(0) % 7
nibabel.save(nibabel.Nifti1Image(grid.astype(numpy.int16), numpy.diag([-10.0, -10.0, 10.0, 1.0])), "in.nii.gz")
nibabel.save(nibabel.Nifti1Image(grid[..., None].astype(numpy.int64), numpy.diag([-10.0, -10.0, 10.0, 1.0]),
                                 dtype="int64"), "wide.nii.gz")
for name in ("in", "wide"):
    for ending in ("nii.gz", "mha"):
        run(supine, "deform", "g.safetensors", "--posture", "prone", "--volume", "rest", "--labels", f"{name}.nii.gz",
            "-o", f"{name}-out.{ending}")
moved = numpy.asarray(nibabel.load("in-out.nii.gz").dataobj)
close("64-bit and 4-D", numpy.asarray(nibabel.load("wide-out.nii.gz").dataobj), moved, 0)
if faults:
    sys.exit("\n".join(faults))
run(supine, "deform", "g.safetensors", "--posture", "prone", "--volume", "rest", "--labels", "in-out.mha",
    "-o", "twice.nii.gz")
run(supine, "deform", "g.safetensors", "--posture", "prone", "--volume", "rest", "--labels", "in-out.nii.gz",
    "-o", "twice2.nii.gz")
close("mha read", numpy.asarray(nibabel.load("twice.nii.gz").dataobj),
      numpy.asarray(nibabel.load("twice2.nii.gz").dataobj), 0)
if shutil.which("plastimatch"):
    run("plastimatch", "convert", "--input", "in-out.mha", "--output-img", "back.nii.gz")
    back = nibabel.load("back.nii.gz")
    close("plastimatch: image", numpy.asarray(back.dataobj), moved, 0)
    close("plastimatch: place", back.affine, nibabel.load("in-out.nii.gz").affine, 1e-3)

# transformix, a program of elastix, takes a displacement field of supine as a transform.
if shutil.which("transformix"):
    with open("t.txt", "w", encoding="utf-8") as file:
        file.write('(Transform "DeformationFieldTransform")\n(NumberOfParameters 0)\n'
                   '(DeformationFieldFileName "f.mha")\n(DeformationFieldInterpolationOrder 1)\n'
                   '(InitialTransformParametersFileName "NoInitialTransform")\n(HowToCombineTransforms "Compose")\n'
                   '(FixedImageDimension 3)\n(MovingImageDimension 3)\n(FixedInternalImagePixelType "float")\n'
                   '(MovingInternalImagePixelType "float")\n(UseDirectionCosines "true")\n'
                   f'(Size {vectors.shape[2]} {vectors.shape[1]} {vectors.shape[0]})\n(Index 0 0 0)\n'
                   f'(Spacing 10 10 10)\n(Origin {origin[0]} {origin[1]} {origin[2]})\n(Direction 1 0 0 0 1 0 0 0 1)\n'
                   '(ResampleInterpolator "FinalBSplineInterpolator")\n(FinalBSplineInterpolationOrder 1)\n(Resampler '
                   '"DefaultResampler")\n'
                   '(DefaultPixelValue 0)\n(ResultImageFormat "mha")\n(ResultImagePixelType "float")\n')
    k, j, i = numpy.unravel_index(numpy.argmax((vectors ** 2).sum(-1)), vectors.shape[:3])
    point = origin + 10 * numpy.array([i, j, k])
    with open("points.txt", "w", encoding="utf-8") as file:
        file.write(f"point\n1\n{point[0]} {point[1]} {point[2]}\n")
    run("transformix", "-def", "points.txt", "-out", ".", "-tp", "t.txt")
    text = open("outputpoints.txt", encoding="utf-8").read() if os.path.exists("outputpoints.txt") else ""
    went = re.search(r"OutputPoint = \[ (\S+) (\S+) (\S+) \]", text)
    close("transformix", [float(x) for x in went.groups()] if went else [numpy.nan] * 3, point + vectors[k, j, i], 1e-2)

# supine reads surfaces that VTK writes, in every encoding.
try:
    import vtk
except ImportError:
    vtk = None
if vtk:
    reader = vtk.vtkPLYReader()
    reader.SetFileName("p.ply")
    reader.Update()
    run(supine, "solve", "p.ply", "--posture", "prone", "-o", "wanted.ply")
    for mode in (vtk.vtkXMLWriter.Ascii, vtk.vtkXMLWriter.Binary, vtk.vtkXMLWriter.Appended):
        for header in (vtk.vtkXMLWriter.UInt32, vtk.vtkXMLWriter.UInt64):
            for packed in (0, 1):
                for encoded in (0, 1) if mode == vtk.vtkXMLWriter.Appended else (1,):
                    writer = vtk.vtkXMLPolyDataWriter()
                    writer.SetInputConnection(reader.GetOutputPort())
                    writer.SetFileName("v.vtp")
                    writer.SetDataMode(mode)
                    writer.SetHeaderType(header)
                    writer.SetEncodeAppendedData(encoded)
                    writer.SetCompressorTypeToZLib() if packed else writer.SetCompressorTypeToNone()
                    writer.SetBlockSize(4096)
                    writer.Write()
                    run(supine, "solve", "v.vtp", "--posture", "prone", "-o", "v.ply")
                    if not os.path.exists("v.ply") or open("v.ply", "rb").read() != open("wanted.ply", "rb").read():
                        faults.append(f"VTK's VTP, mode {mode}, header {header}, packed {packed}, encoded {encoded}")

# supine reads a 3MF file in the unit that it states.
CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
TARGET = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
RELATIONSHIPS = "http://schemas.openxmlformats.org/package/2006/relationships"


def read_obj(path):
    """Return the vertices and the triangles, counted from 1."""
    rows = [line.split() for line in open(path, encoding="utf-8")]
    return [numpy.array([row[1:4] for row in rows if row and row[0] == kind], float) for kind in ("v", "f")]


def write_3mf(path, vertices, triangles, unit, method, model="3D/3dmodel.model"):
    """Write a surface in a unit of the format ('' to state none)."""
    corners = "".join('<vertex x="%.9g" y="%.9g" z="%.9g"/>' % tuple(row) for row in vertices)
    faces = "".join('<triangle v1="%d" v2="%d" v3="%d"/>' % tuple(row - 1) for row in triangles)
    stated = f'unit="{unit}"' if unit else ""
    with zipfile.ZipFile(path, "w", method) as file:
        file.writestr("_rels/.rels", f'<Relationships xmlns="{RELATIONSHIPS}"><Relationship Id="r" Type="{TARGET}" '
                                     f'Target="/{model}"/></Relationships>')
        file.writestr(model, f'<?xml version="1.0"?><model {stated} xmlns="{CORE}"><resources><object id="1" '
                             f'type="model"><mesh><vertices>{corners}</vertices><triangles>{faces}</triangles></mesh>'
                             '</object></resources><build><item objectid="1"/></build></model>')


run(supine, "deform", "l.safetensors", "--posture", "prone", "-o", "in.obj")
run(supine, "solve", "in.obj", "--posture", "prone", "-o", "wanted.obj")
surface = read_obj("in.obj")
for unit, millimetres, method in (("", 1, 0), ("millimeter", 1, 8), ("inch", 25.4, 8), ("centimeter", 10, 0),
                                  ("foot", 304.8, 8)):
    write_3mf("in.3mf", surface[0] / millimetres, surface[1], unit, method)
    run(supine, "solve", "in.3mf", "--posture", "prone", "-o", "got.obj")
    boxes = [[vertices.min(0), vertices.max(0), vertices.mean(0)]  # assimp numbers the vertices of OBJ anew
             for vertices, _ in map(read_obj, ("got.obj", "wanted.obj"))]
    close(f"3MF in '{unit}'", *boxes, 0.01)
for words, unit, model in (('the unit "ell" is unknown', "ell", "3D/3dmodel.model"),
                           ("no readable model", "inch", "3D/other.model")):
    write_3mf("in.3mf", *surface, unit, 8, model)
    refused = subprocess.run([supine, "solve", "in.3mf", "--posture", "prone", "-o", "got.obj"], capture_output=True,
                             text=True, check=False)
    if refused.returncode != 2 or "in.3mf: " not in refused.stderr or words not in refused.stderr:
        faults.append(f"3MF, {words}: {refused}")

# supine reads a folder of TotalSegmentator masks, writes to a pipe, and accepts a file name that is not UTF-8.
os.mkdir("segmentations")
where = numpy.indices((58, 46, 40)).transpose(1, 2, 3, 0) * [5, 4, 6] + [-141.3, -85.7, -113.9]
x, y, z = numpy.moveaxis(where, -1, 0)
wide = (abs(x) - 66) / (numpy.where(x > 0, 58, 53) * (1 - .2 * z / 100))
lungs = wide ** 2 + ((y - .25 * z) / 60) ** 2 + (z / 100) ** 2 < 1
affine = numpy.diag([5.0, 4.0, 6.0, 1.0])
affine[:3, 3] = [-141.3, -85.7, -113.9]
for name, part in (("upper_lobe_left", (x < 0) & (z > 0)), ("lower_lobe_left", (x < 0) & (z <= 0)),
                   ("upper_lobe_right", (x > 0) & (z > 30)), ("middle_lobe_right", (x > 0) & (z <= 30) & (z > -10)),
                   ("lower_lobe_right", (x > 0) & (z <= -10))):
    nibabel.save(nibabel.Nifti1Image((lungs & part).astype(numpy.uint8), affine), f"segmentations/lung_{name}.nii.gz")
nibabel.save(nibabel.Nifti1Image(lungs.astype(numpy.uint8), affine), "segmentations/heart.nii.gz")
said = run(supine, "solve", "segmentations", "--edge", "5", "--posture", "prone", "-o", "folder.ply")
if "labels 1, 2 left; 3, 4, 5 right" not in said:
    faults.append(f"folder of masks: {said}")
run(supine, "precompute", "segmentations", "--edge", "8", "--units", "mm", "--held-out", "20", "-o", "s.safetensors")
said = run(supine, "embed", "s.safetensors", "segmentations", "--labels", "all", "-o", "lobes.safetensors")
if any(f": lung_{name}," not in said for name in ("upper_lobe_left", "middle_lobe_right", "lower_lobe_right")):
    faults.append(f"folder of masks that is embedded: {said}")
for ending in ("ply", "obj", "stl", "vtp"):
    run(supine, "deform", "l.safetensors", "--posture", "prone", "-o", f"a.{ending}")
    for name in (f"-.{ending}",) + (("-",) if ending == "ply" else ()):
        piped = subprocess.run([supine, "deform", "l.safetensors", "--posture", "prone", "-o", name],
                               capture_output=True, check=False)
        if piped.stdout != open(f"a.{ending}", "rb").read():
            faults.append(f"-o {name}: {len(piped.stdout)} bytes; {piped.stderr}")
shutil.copy("l.safetensors", b"n\xe9.safetensors")
listed = subprocess.run([supine.encode(), b"info", b"n\xe9.safetensors", b"--json"], capture_output=True, check=False)
if listed.returncode != 0 or '"n?.safetensors"' not in listed.stdout.decode("utf-8"):
    faults.append(f"a name that is not UTF-8: {listed}")

for fault in faults:
    print(fault)
print(f"{len(faults)} faults")
sys.exit(1 if faults else 0)
