# SPDX-License-Identifier: GPL-3.0-or-later
"""Give a right and a wrong input of every row of the table of checks (docs/inputs.md) to every interface that takes it,
and show the verdicts: taken, told (a warning) or refused. All interfaces must give the same one.

    python3 tests/inputs.py [BUILD_FOLDER]

The folder, build/release by default, must have the program and the shared libraries. JavaScript runs if the target
`npm` was built and node is installed. To add a row: add it to base/inputs.c, and its cases to CASES below."""
import ctypes
import functools
import os

from helpers.nifti import header
from helpers.verdict import (command, even, javascript, leave, pose_in_c, python, stream, supine, table,
                             transform, write_ply)
import numpy as np
from supine import _library as c

INTERFACES = ("command", "C", "Python", "JavaScript")


def state(posture, volume="", javascript_state=None):
    """A state, in all interfaces. JavaScript takes posture and volume as one text."""
    text = javascript_state or (f"{posture}:{volume}" if volume else posture)
    return {"command": lambda: command("deform", "lungs.safetensors", "--posture", posture,
                                       *(["--volume", volume] if volume else []), "-o", "out.ply"),
            "C": lambda: python(lambda: pose_in_c(lungs, posture, volume)),
            "Python": lambda: python(lambda: lungs.pose(posture, volume)),
            "JavaScript": lambda: javascript(text, "lungs.safetensors")}


def made(path, **options):
    """A basis made from a surface. The Python package passes the options to the C library."""
    options = options if "fields" in options else {"held_out": 20, **options}
    words = [word for key, value in options.items() for word in ("--" + key.replace("_", "-"), value)]
    return {"command": lambda: command("precompute", path, *words, "-o", "out.safetensors"),
            "C": lambda: python(lambda: supine.precompute(path, **options)),
            "Python": lambda: python(lambda: supine.precompute(path, **options))}


def nearest_to_line(first, second):
    """Return two vertices and the third that lies nearest to the line through them, between them."""
    a, b = lungs.vertices[[first, second]]
    share = np.clip((lungs.vertices - a) @ (b - a) / ((b - a) @ (b - a)), 0.2, 0.8)
    away = np.linalg.norm(lungs.vertices - a - share[:, None] * (b - a), axis=1)
    return first, second, int(away.argmin())


def registered(*vertices):
    """Register the lungs at vertices."""
    def by_command():
        places = lungs.deform(lungs.pose("supine:scan"))[list(vertices)]
        with open("frame.csv", "w", encoding="utf-8") as file:
            file.write("name,x,y,z\n" + "".join(f"p{i},{x:.6f},{y:.6f},{z:.6f}\n"
                                                for i, (x, y, z) in enumerate(places)))
        return command("deform", "lungs.safetensors", "--posture", "prone:rest", "--frame", "frame.csv", "-o",
                       "out.ply")

    by_python = lambda: python(lambda: lungs.registration("prone:rest", vertices))
    return {"command": by_command, "C": by_python, "Python": by_python,
            "JavaScript": lambda: javascript("prone:rest", "lungs.safetensors", *vertices)}


def points(z):
    with open("points.csv", "w", encoding="utf-8") as file:
        file.write(f"name,x,y,z\nin,-80,-120,-90\nother,-80,-120,{z}\n")


def embedded(z):
    def run(call):
        points(z)
        return call()
    return {"command": lambda: run(lambda: command("embed", "lungs.safetensors", "points.csv", "-o",
                                                   "out.safetensors")),
            "Python": lambda: run(lambda: python(lambda: supine.embed(lungs, "points.csv")))}


def located(volume, degrees=0.0, scale=(1, 1, 1)):
    """Locate the lungs from points where they are in supine posture at rest, in a frame that is turned; or of lungs of
    another size."""
    names = list(inside.points)
    vertices = [inside.points[name] for name in names]
    seen = inside.deform(inside.pose("supine:rest"))[vertices].astype(float)
    t, mean = np.radians(degrees), seen.mean(axis=0)
    turn = np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]])
    seen = (seen - mean) @ turn.T * scale + mean

    def by_command():
        with open("seen.csv", "w", encoding="utf-8") as file:
            file.write("name,x,y,z\n" +
                       "".join(f"{name},{x:.6f},{y:.6f},{z:.6f}\n" for name, (x, y, z) in zip(names, seen)))
        return command("locate", "lungs.safetensors", "seen.csv", "--points", "inside.safetensors", "--posture",
                       "supine", "--volume", volume, "-o", "found.csv")

    by_python = lambda: python(lambda: inside.locate(vertices, seen, "supine", volume))
    return {"command": by_command, "C": by_python, "Python": by_python}


def tracked(status, device="Patient"):
    """Send a pose to the live lungs."""
    return {"command": lambda: stream("lungs.safetensors", "--device", device, message=transform(status=status))}


def suggested(word):
    """The verdict is `told` if a word is suggested."""
    def verdict(run):
        done = run()
        if done is None:
            return None
        assert done[0] == "refused", done
        return ("taken" if "did you mean" in done[1] else "told"), done[1]
    return {name: lambda run=run: verdict(run) for name, run in state(word).items()}


def breath(ml):
    return {"command": lambda: command("compare", "lungs.safetensors", "--postures", "supine", "--breath", f"{ml}mL")}


def gained(gain):
    """The displacements of lungs whose volumes at rest and at full inflation are unknown, multiplied by a gain."""
    @functools.cache  # the C library uses it while it is open
    def basis():
        if not os.path.exists("unknown.safetensors"):
            supine.precompute("lungs.ply", scanned="none", held_out=20, output="unknown.safetensors")
        return supine.open("unknown.safetensors")
    down = (ctypes.c_double * 3)(0.0, -1.0, 0.0)
    return {"C": lambda: python(lambda: c.basis_pose_gain(basis()._c, down, gain, supine.Pose())),
            "Python": lambda: python(lambda: basis().pose("prone").fill(gain)),
            "JavaScript": lambda: basis() and javascript({"gravity": [0, -1, 0], "gain": gain}, "unknown.safetensors")}


def tidal(ml):
    """A breath of a tidal volume."""
    breathe = lambda: python(lambda: supine.breath([0.0, 1.0], tidal=ml))
    return {"command": lambda: command("breathe", "lungs.safetensors", "--posture", "supine", "--fps", "1", "--tidal",
                                       f"{ml}mL", "-o", "out.vtp"), "C": breathe, "Python": breathe}


def field(posture):
    return {"command": lambda: command("deform", "grid.safetensors", "--posture", posture, "--field", "field.nrrd")}


def members(value):
    given = value if isinstance(value, dict) else list(value)
    return {"JavaScript": lambda: javascript(given, "lungs.safetensors"),
            "Python": lambda: python(lambda: lungs.pose(given.get("gravity", given) if isinstance(given, dict)
                                                        else given,
                                                        given.get("volume", "") if isinstance(given, dict) else ""))}


def write_nrrd(name, voxels, origin=None):
    """Write an array [z, y, x] on the grid of the basis `nodes`."""
    kind = {"uint8": "uchar", "int16": "short", "float32": "float"}[voxels.dtype.name]
    vector = lambda v: "(" + ",".join(f"{x:.6f}" for x in v) + ")"
    with open(name, "wb") as file:
        file.write((f"NRRD0004\ntype: {kind}\ndimension: 3\nspace: left-posterior-superior\nsizes: "
                    + " ".join(map(str, voxels.shape[::-1])) + "\nspace directions: " + " ".join(map(vector, frame[1:]))
                    + f"\nspace origin: {vector(frame[0] if origin is None else origin)}\nencoding: raw\nendian: "
                    f"little\n\n").encode())
        file.write(np.ascontiguousarray(voxels).tobytes())


def mapped(voxels, **options):
    """A basis made from a label map."""
    def run(call):
        write_nrrd("map.nrrd", voxels)
        return call()
    return {key: lambda call=call: run(call) for key, call in made("map.nrrd", edge=8, **options).items()}


def nifti(offset):
    """A basis made from a label map in NIfTI whose header says that the voxels begin at `offset`."""
    def run(call):
        rows = np.diag([-1, -1, 1]) @ np.column_stack([frame[1:].T, frame[0]])
        with open("map.nii", "wb") as file:
            file.write(header(sides.shape[::-1], 8, rows, offset) + sides.tobytes())
        return call()
    return {key: lambda call=call: run(call) for key, call in made("map.nii", edge=8).items()}


def imaged(voxels, *words, shift=0.0):
    """A CT that moves with the lungs."""
    def run():
        write_nrrd("ct.nrrd", voxels, frame[0] + [0, 0, shift])
        return command("deform", "grid.safetensors", "--posture", "prone:rest", "--image", "ct.nrrd", *words, "-o",
                       "moved.nrrd")
    return {"command": run}


def labelled(voxels):
    """A label map that moves with the lungs."""
    def run():
        write_nrrd("map.nrrd", voxels, frame[0])
        return command("deform", "grid.safetensors", "--posture", "prone:rest", "--labels", "map.nrrd", "-o",
                       "moved.nrrd")
    return {"command": run}


def speckled(voxels):
    """Replace every twelfth voxel of the lungs by soft tissue."""
    voxels = voxels.copy()
    voxels.ravel()[np.flatnonzero(voxels < -500)[::12]] = 40
    return voxels


def scanned(scale, left=1.0):
    """Validate a basis by a scan at rest that is scaled, its left lung along z."""
    def run():
        vertices = lungs.deform(lungs.pose("supine:rest")).astype(float)
        mean = vertices.mean(axis=0)
        height = np.where(np.asarray(lungs.tensor("lung")).ravel() == 0, left, 1.0)
        vertices = (vertices - mean) * scale * np.column_stack([height ** 0, height ** 0, height]) + mean
        write_ply("scan.ply", vertices, lungs.triangles)
        return command("validate", "lungs.safetensors", "--state", "supine:scan.ply", "--units", "mm")
    return {"command": run}


def fitted(rest, scan="rest.ply"):
    """Fit a scan at rest, or another, called `rest`, and one at full inflation."""
    return {"command": lambda: command("fit", scan, "lungs.ply", "--rest", rest, "--other", "supine:full", "-o",
                                       "fitted.json")}


def paired(*words, mismatched=0, shift=0.0):
    """Validate a basis by landmarks from the scan to rest."""
    def run():
        place = np.flatnonzero(depth > 8)[::7]
        first = nodes.vertices[place].astype(float)
        second = nodes.deform(nodes.pose("supine:rest"))[place].astype(float)
        second[10:10 + mismatched] = second[-mismatched - 1:-1]
        with open("pairs.csv", "w", encoding="utf-8") as file:
            file.write("x,y,z,to_x,to_y,to_z\n")
            np.savetxt(file, np.column_stack([first, second]) + [shift, 0, 0, shift, 0, 0], "%.4f", ",")
        return command("validate", "lungs.safetensors", "--landmarks", "pairs.csv", "--to", "supine:rest", *words)
    return {"command": run}


def write_dae(name, up):
    """Write the lungs as a COLLADA file that says which axis is up."""
    points_, corners = " ".join(f"{x:.4f}" for x in lungs.vertices.ravel()), " ".join(map(str, lungs.triangles.ravel()))
    n, t = len(lungs.vertices), len(lungs.triangles)
    with open(name, "w", encoding="utf-8") as file:
        file.write(
            '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
            f'<asset><unit meter="1"/><up_axis>{up}</up_axis></asset>'
            '<library_geometries><geometry id="g"><mesh><source id="s">'
            f'<float_array id="f" count="{3 * n}">{points_}</float_array>'
            f'<technique_common><accessor source="#f" count="{n}" stride="3"><param name="X" type="float"/>'
            '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
            '<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>'
            f'<triangles count="{t}"><input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p></triangles>'
            '</mesh></geometry></library_geometries>'
            '<library_visual_scenes><visual_scene id="c"><node id="n"><instance_geometry url="#g"/></node>'
            '</visual_scene></library_visual_scenes>'
            '<scene><instance_visual_scene url="#c"/></scene></COLLADA>')


# For each row: a right input, a wrong one, and the verdict on the wrong one.
CASES = {
    "volumes-of-a-state": (state("prone", "rest"),
                           state("prone:rest", "full", {"posture": "prone:rest", "volume": "full"}), "refused"),
    "tilt": (state("left+45"), state("supine+500"), "refused"),
    "roll": (state("supine@30"), state("supine@200"), "refused"),
    "volume-finite": (state("prone:rest+100"), state("prone:rest+1e300"), "refused"),
    "volume-least": (state("prone:2L"), state("prone:50mL"), "refused"),
    "volume-most": (state("supine:full"), state("supine:9L"), "refused"),
    "folds": (state("0:1:-1:2L"), state("0:1:-1:700mL"), "refused"),
    "field-folds": (field("prone:rest"), field("0:1:-1:700mL"), "refused"),
    "breath": (breath(500), breath(3500), "told"),
    "gain": (gained(1.0), gained(9.81), "refused"),
    "breath-least": (tidal(500), tidal(0.5), "refused"),
    "state-members": (members({"gravity": [0, -1, 0], "volume": "rest"}),
                      members({"posture": "prone", "volume": "rest"}), "refused"),
    "point-outside": (embedded(-100), embedded(900), "refused"),
    "content-outside": (lambda: embedded(-100), lambda: embedded(solid[:, 2].max() + 20), "told"),
    "device-name": (tracked("OK"), tracked("OK", "a_name_of_21_letters_"), "refused"),
    "tracker-invalid": (tracked("OK"), tracked("INVALID"), "told"),
    "frame-line": (lambda: registered(0, 100, 200, lungs.vertex_count - 1),
                   lambda: registered(*nearest_to_line(0, 1)), "refused"),
    "height-least": (made("lungs.ply", height=160, sex="female"), made("lungs.ply", height=135, sex="female"), "told"),
    "height-most": (made("lungs.ply", height=180, sex="male"), made("lungs.ply", height=200, sex="male"), "told"),
    "rest-share": (made("lungs.ply", height=180, sex="male"), made("lungs.ply", height=230, sex="male"), "refused"),
    "lung-share": (made("lungs.ply", lung="left:0.3"), made("lungs.ply", lung="left:0.001"), "refused"),
    "lungs-small": (made("small.ply", units="mm"), made("small.ply", units="mm", height=170), "told"),
    "locate-residuals": (lambda: located("rest"), lambda: located("full"), None),
    "locate-turned": (lambda: located("rest"), lambda: located("rest", 25.0), None),
    "locate-stretched": (lambda: located("rest"), lambda: located("rest", scale=(1.25, 1, 0.9)), "told"),
    "label-value": (lambda: mapped(sides.astype(np.float32) + np.float32(1e-4)),
                    lambda: mapped(sides.astype(np.float32) * 1.5), "refused"),
    "labels-ratio": (lambda: mapped(sides), lambda: mapped(tumour(8)), "refused"),
    "labels-pieces": (lambda: mapped(sides), lambda: mapped(bed()), "refused"),
    "labels-sides": (lambda: mapped(sides),
                     lambda: mapped(np.where(sides == 0, 0, 1 + (row_of(2) < row_of(2)[sides > 0].mean() - 2))
                                                           .astype(np.uint8)), "refused"),
    "labels-order": (lambda: mapped(lobes((1, 2, 3, 4, 5))), lambda: mapped(lobes((4, 5, 1, 2, 3))), "refused"),
    "lung-pieces": (lambda: mapped(sides, labels="left=1,right=2"), lambda: mapped(bed(), labels="left=1,right=2"),
                    "told"),
    "lung-cut": (lambda: mapped(sides), lambda: mapped(sides[24:]), "told"),
    "lung-hollow": (lambda: made("lungs.ply"), lambda: made("hollow.ply"), "refused"),
    "lungs-level": (lambda: made("lungs.ply"), lambda: made("apart.ply"), "told"),
    "voxels-begin": (lambda: nifti(352), lambda: nifti(0), "refused"),
    "image-frame": (lambda: imaged(ct), lambda: imaged(ct, shift=900.0), "told"),
    "labels-lungs": (lambda: labelled(with_liver()), lambda: labelled(sides[:, :, ::-1]), "told"),
    "image-labels": (lambda: imaged(ct), lambda: imaged(sides.astype(ct.dtype)), "told"),
    "ct-frame": (lambda: imaged(ct, "--density"), lambda: imaged(ct, "--density", shift=900.0), "refused"),
    "ct-air": (lambda: imaged(ct, "--density"), lambda: imaged(-ct - 810, "--density"), "refused"),
    "ct-soft": (lambda: imaged(ct, "--density"), lambda: imaged(speckled(ct), "--density"), "told"),
    "one-person": (lambda: scanned((1, 1, 1)), lambda: scanned((0.8, 1, 1)), "told"),
    "rest-least": (lambda: fitted("supine:rest"), lambda: fitted("supine:rest+1500"), "told"),
    "rest-most": (lambda: fitted("supine:rest"), lambda: fitted("supine:rest-2500"), "told"),
    "scans-apart": (lambda: fitted("supine:rest"), lambda: fitted("supine:full-18", "again.ply"), "told"),
    "landmarks-outside": (lambda: paired(), lambda: paired(shift=30.0), "told"),
    "landmarks-order": (lambda: paired(), lambda: paired("--reverse"), "refused"),
    "landmarks-match": (lambda: paired(), lambda: paired(mismatched=3), "told"),
    "patient-box": (lambda: made("lungs.ply", patient="patient.json"), lambda: made("high.ply", patient="patient.json"),
                    "told"),
    "patient-volume": (lambda: made("lungs.ply", patient="patient.json"),
                       lambda: made("full.ply", patient="patient.json"), "told"),
    "surface-turned": (lambda: made("up.dae", axes="LSA"), lambda: made("up.dae"), "refused"),
    "suggestion": (suggested("pron"), suggested("Bauchlage"), "told"),
    "fields-directions": (lambda: simulated(), lambda: simulated(directions=np.eye(3)), "refused"),
    "fields-gap": (lambda: simulated(), lambda: simulated(directions=even(40)[even(40)[:, 1] > 0.05]), "told"),
    "fields-positions": (lambda: simulated(), lambda: simulated(change=lambda u: u + solid), "refused"),
    "fields-gravity": (lambda: simulated(),
                       lambda: simulated(directions=np.where(np.arange(40) % 2, 1, 2)[:, None] * even(40)), "refused"),
    "fields-repeated": (lambda: simulated(volumes=3),
                        lambda: simulated(directions=np.concatenate([even(40), even(40)[:5]]), change=partly_reversed),
                        "refused"),
    "fields-copy": (lambda: simulated(), lambda: simulated(change=with_copy), "told"),
    "fields-zero": (lambda: simulated(), lambda: simulated(change=lambda u: with_run(u, 0)), "told"),
    "fields-node": (lambda: simulated(), lambda: simulated(change=with_node), "told"),
    "fields-large": (lambda: simulated(), lambda: simulated(change=lambda u: (u - u.mean(0)) * 10), "told"),
    "fields-frame": (lambda: simulated(), lambda: simulated(change=lambda u: u * [-1, -1, 1]), "told"),
    "fields-unit": (lambda: simulated(), lambda: simulated(change=lambda u: u / 1000), "told"),
    "fields-run-size": (lambda: simulated(directions=even(200)),
                        lambda: simulated(directions=even(200), change=lambda u: with_run(u, 7)), "told"),
    "fields-run-error": (lambda: simulated(volumes=3), lambda: simulated(change=lambda u: with_run(u, -1)), "told"),
    "fields-left-out": (lambda: simulated(volumes=3), lambda: simulated(volumes=3, change=shuffled), "refused"),
    "fields-volume": (lambda: simulated_volume(1.2), lambda: simulated_volume(2.0), "refused"),
    "basis-error": (lambda: simulated(), lambda: simulated(band=0), "refused"),
}


def simulated(directions=None, volumes=1, change=lambda u: u, **options):
    """Fields of another simulator: the lungs sag along gravity, the lower part more, and widen with their volume."""
    directions = even(40) if directions is None else directions
    place = (solid - solid.mean(axis=0)) / 100
    filling = np.linspace(0, 1, volumes) if volumes > 1 else [0.0]
    field = lambda g, s: ((5 - (place ** 2).sum(1))[:, None] * g + 3 * np.tanh(place @ g)[:, None] * place +
                          12 * s * place)
    gravity = np.array([g for g in directions for s in filling])
    displacement = change(np.array([field(g, s) for g in directions for s in filling]))

    def written(call):
        supine.save_fields("given.safetensors", solid, gravity, displacement)
        return call()
    calls = made("lungs.ply", fields="given.safetensors", **options)
    return {key: lambda call=call: written(call) for key, call in calls.items()}


def simulated_volume(factor):
    """A total volume of lungs that were simulated at 100 to 140 % of their volume."""
    def run(call):
        place = (solid - solid.mean(axis=0)) / 100
        filling = np.linspace(0, 1, 3)
        gravity = np.array([g for g in even(20) for s in filling])
        field = np.array([5 * g + 12 * s * place for g in even(20) for s in filling])
        supine.save_fields("given.safetensors", solid, gravity, field)
        basis = supine.precompute("lungs.ply", fields="given.safetensors", output="simulated.safetensors")
        return call(basis, f"prone:{factor * sum(basis.volumes(basis.pose('prone'))):.0f}mL")
    return {"command": lambda: run(lambda _, text: command("deform", "simulated.safetensors", "--posture", text, "-o",
                                                           "out.ply")),
            "C": lambda: run(lambda basis, text: python(lambda: pose_in_c(basis, text))),
            "Python": lambda: run(lambda basis, text: python(lambda: basis.pose(text))),
            "JavaScript": lambda: run(lambda _, text: javascript(text, "simulated.safetensors"))}


def with_run(displacement, factor):
    """Scale one run."""
    displacement[7] *= factor
    return displacement


def with_copy(displacement):
    """Let one run be a copy of another."""
    displacement[7] = displacement[6]
    return displacement


def with_node(displacement):
    """Displace one point of one run by 60 mm more."""
    displacement[7, 11, 0] += 60
    return displacement


def partly_reversed(displacement):
    """Reverse the last five runs."""
    displacement[-5:] *= -1
    return displacement


def shuffled(displacement):
    """Put the runs in another order than their directions."""
    order = np.random.default_rng(2).permutation(len(displacement) // 3)
    return displacement.reshape(-1, 3, *displacement.shape[1:])[order].reshape(displacement.shape)


def row_of(axis):
    """The index of each voxel along x, y or z."""
    return np.indices(sides.shape)[2 - axis]


def with_liver():
    """The lungs, and below the right one an organ that reaches beyond the midline."""
    columns = (sides > 0).any(0) & (np.arange(sides.shape[2]) < 0.6 * sides.shape[2])
    return np.where(columns & ((sides > 0).cumsum(0) == 0), 3, sides).astype(sides.dtype)


def tumour(radius):
    """Label 1 holds both lungs, label 2 a ball in the left one."""
    middle = np.argwhere(sides == 1).mean(axis=0)
    near = np.linalg.norm(np.moveaxis(np.indices(sides.shape), 0, -1) - middle, axis=-1) * 8 < 8 * radius / 2
    return np.where(near & (sides == 1), 2, np.minimum(sides, 1)).astype(np.uint8)


def bed():
    """The lungs, and a part apart from them with the label of one."""
    voxels = sides.copy()
    voxels[5:45, -2:, 5:20] = sides[:, :, :sides.shape[2] // 2].max()
    return voxels


def lobes(order):
    """Two lobes of the left lung and three of the right one, from head to feet, with these labels."""
    height = row_of(2).astype(float)
    voxels = np.zeros_like(sides)
    for side, labels in ((left, order[:2]), (3 - left, order[2:])):
        part = sides == side
        share = (height - height[part].min()) / (height[part].max() - height[part].min() + 1)
        voxels[part] = np.array(labels)[((1 - share[part]) * len(labels) * 0.999).astype(int)]
    return voxels


def grid_of():
    """Voxelise the lungs on the grid of a basis: sides of voxels, 1 and 2, depths, and an image like a CT."""
    assert command("embed", "lungs.safetensors", "--grid", 8, "-o", "grid.safetensors")[0] == "taken"
    basis = supine.open("grid.safetensors")
    steps, shape = np.asarray(basis.tensor("grid"), float), tuple(int(n) for n in basis.tensor("grid_size"))[::-1]
    place = np.rint((basis.vertices - steps[0]) @ np.linalg.inv(steps[1:])).astype(int).T[::-1]
    deep = np.asarray(basis.tensor("depth")).ravel()
    voxels = np.zeros(shape, np.uint8)
    voxels[tuple(place)] = np.where(deep > 0, 1 + np.asarray(basis.tensor("lung")).ravel(), 0)
    return basis, steps, deep, voxels, np.where(voxels > 0, -850, 40).astype(np.int16)


def prepare():
    """Make the inputs that the cases share."""
    assert command("phantom", "--vertices", 3000, "-o", "lungs.ply")[0] == "taken"
    assert command("precompute", "lungs.ply", "--held-out", 20, "-o", "lungs.safetensors")[0] == "taken"
    opened = supine.open("lungs.safetensors")
    number = np.random.default_rng(1)
    low, high = (np.array(b) for b in ([-120, -180, -200], [-60, -100, -60]))
    with open("inside.csv", "w", encoding="utf-8") as file:
        file.write("name,x,y,z\n")
        for i in range(12):
            x, y, z = low + number.random(3) * (high - low)
            file.write(f"p{i},{x * (-1) ** i:.3f},{y:.3f},{z:.3f}\n")
    assert command("embed", "lungs.safetensors", "inside.csv", "-o", "inside.safetensors")[0] == "taken"
    return opened, supine.open("inside.safetensors")


lungs, inside = prepare()
nodes, frame, depth, sides, ct = grid_of()
left = 1  # the label of the left lung, which is lung 0
solid, corners = lungs.vertices.astype(float), lungs.triangles
write_ply("small.ply", 0.87 * solid, corners)
write_ply("high.ply", (solid - solid.mean(axis=0)) * [1, 1, 1.08] + solid.mean(axis=0), corners)
write_ply("full.ply", (solid - solid.mean(axis=0)) * 1.04 + solid.mean(axis=0), corners)
first_lung = np.asarray(lungs.tensor("lung")).ravel()
middles = np.array([solid[first_lung == j].mean(axis=0) for j in (0, 1)])[first_lung]
write_ply("apart.ply", solid + np.where(first_lung == 0, 0, 60)[:, None] * [0, 1, 0], corners)
write_ply("hollow.ply", np.concatenate([solid, middles + 0.97 * (solid - middles)]),
          np.concatenate([corners, corners[:, ::-1] + len(solid)]))
write_ply("rest.ply", lungs.deform(lungs.pose("supine:rest")).astype(float), corners)
write_ply("again.ply", (solid - solid.mean(axis=0)) * 0.999 + solid.mean(axis=0), corners)
write_dae("up.dae", "Z_UP")
command("fit", "rest.ply", "lungs.ply", "--other", "supine:full", "-o", "patient.json")
faults = []
rows = table()
print(f"{'check':20} {'input':6} " + " ".join(f"{name:11}" for name in INTERFACES))
for row in rows:
    name = row.name.decode()
    if name not in CASES:
        faults.append(f"{name}: no cases")
        continue
    right, wrong, expected = CASES[name]
    wanted = {interface for i, interface in enumerate(INTERFACES) if row.interfaces >> i & 1}
    for kind, case in (("right", right), ("wrong", wrong)):
        calls = case() if callable(case) else case
        if set(calls) != wanted:
            faults.append(f"{name}: the table says {sorted(wanted)}, the cases {sorted(calls)}")
        said = {interface: call() for interface, call in calls.items()}
        verdicts = {interface: done[0] for interface, done in said.items() if done is not None}
        print(f"{name:20} {kind:6} " + " ".join(f"{verdicts.get(interface, '-'):11}" for interface in INTERFACES))
        good = {"taken"}
        if kind == "wrong":
            good = {expected} if expected else {"told", "refused"}
        if len(set(verdicts.values())) > 1 or not set(verdicts.values()) <= good:
            faults.append(f"{name}, {kind}: {verdicts}, not {sorted(good)}: " + "; ".join(
                done[1].strip().split("\n")[-1] for done in said.values() if done is not None))
for name in CASES.keys() - {row.name.decode() for row in rows}:
    faults.append(f"{name}: not in the table")
print("\n".join(faults) if faults else f"{len(rows)} rows: the interfaces agree")
leave(1 if faults else 0)
