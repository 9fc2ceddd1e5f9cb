# SPDX-License-Identifier: GPL-3.0-or-later
"""Test supine.augment and supine.Deform on synthetic lungs: test_augment.py SOURCE_FOLDER PROGRAM LIBRARY

Samples equal what `warp` and `deform` compute; the memory does not grow with the number of states, and nothing but
links and a pipe is written to a folder. Deform is called as transforms of MONAI and TorchIO are, with numpy arrays."""
import glob
import os
import resource
import shutil
import subprocess
import sys
import tempfile

try:
    import numpy as np
except ImportError:
    print("skipped: no numpy")
    sys.exit(77)

source, program, library = sys.argv[1:4]
work = tempfile.TemporaryDirectory()
os.environ["TMPDIR"] = tempfile.tempdir = work.name
package = os.path.join(work.name, "python", "supine")
shutil.copytree(os.path.join(source, "runtime/python/supine"), package)
shutil.copy(library, os.path.join(package, "libsupine_runtime.so"))
os.symlink(program, os.path.join(package, "supine"))
sys.path.insert(0, os.path.dirname(package))
import supine  # noqa: E402

os.chdir(work.name)
subprocess.run([program, "phantom", "--vertices", "1000", "-o", "lungs.ply"], stdout=subprocess.DEVNULL, check=True)
lungs = supine.precompute("lungs.ply", held_out=20)
number = np.random.default_rng(5)
low, high = lungs.vertices.min(axis=0) - 20, lungs.vertices.max(axis=0) + 20
step = np.array([7.0, 8.0, 9.0])
size = np.ceil((high - low) / step).astype(int)[::-1]
ct = (-800 + 100 * number.random(size)).astype(np.int16)
# Oblique sheets, which are not compact: compact parts are found in a CT, where there is one, or else in the labels.
labels = (np.indices(size).sum(axis=0) // 3 % 5).astype(np.uint8)
points = [(-80.0, -150.0, -120.0), (75.0, -170.0, -150.0)]
scan = {"step": step, "origin": low}
states = ["prone:rest", "left=rest+200,right=rest+300", "left+5:full-400"]
grid = supine.embed(lungs, grid=8.0)


def test_augment_three_states_equals_warp_and_deform():
    inside = supine.embed(lungs, np.array(points))
    samples = list(supine.augment(lungs, ct, labels=labels, points=np.array(points), states=states, grid=8.0, **scan))
    assert [sample.state for sample in samples] == states
    for sample, image, label in zip(samples, grid.warp(ct, states, density=True, **scan),
                                    grid.warp(labels, states, labels=True, **scan)):
        assert sample.image.dtype == np.int16 and (sample.image == image).all() and (sample.image != ct).any()
        assert (sample.labels == label).all() and (sample.labels != labels).any()
        # the basis has the point of the left lung first, unlike `points`
        pose, order = inside.pose(sample.state), [1, 0]
        assert (sample.points == inside.deform(pose)[order]).all()
        assert np.abs(sample.points - np.array(points)).max() < 80
        assert (sample.points_error == inside.expected_error(sample.state)[order]).all()
        known = ~np.isnan(sample.error)
        assert known.sum() == grid.vertex_count and sample.error.shape == sample.field.shape[:3]
        where = np.argwhere(known)[:, ::-1] * sample.field_step + sample.field_origin
        order, found = np.lexsort(np.rint(grid.vertices).T), np.lexsort(np.rint(where).T)
        assert np.abs(grid.vertices[order] - where[found]).max() < 0.01
        shift = grid.deform(grid.pose(sample.state)) - grid.vertices
        assert np.abs(sample.field[known][found] - shift[order]).max() < 0.01


def test_augment_rigid_label_keeps_size():
    ball, z, y, x = labels * 0, *np.meshgrid(*(np.arange(n) * s for n, s in zip(size, step[::-1])), indexing="ij")
    ball[np.linalg.norm([x + low[0] - 75, y + low[1] + 170, z + low[2] + 150], axis=0) < 30] = 1
    sizes = []
    for rigid in ([], [1]):
        moved = next(supine.augment(lungs, labels=ball, states=["supine:rest"], grid=8.0, rigid=rigid, **scan))
        sizes.append((moved.labels == 1).sum() / ball.sum())
    print("volume of a ball", sizes)
    assert sizes[0] < 0.8 and abs(sizes[1] - 1) < 0.1
    try:
        next(supine.augment(lungs, states=["prone"], rigid=[1], **scan))
        raise AssertionError("rigid without labels is not refused")
    except ValueError as error:
        assert "labels" in str(error)


def test_augment_missing_parts_none():
    sample, = supine.augment(lungs, labels=labels, states=["prone"], grid=8.0, **scan)
    assert sample.image is None and sample.points is None and sample.labels.shape == labels.shape
    sample, = supine.augment(lungs, states=["prone"], grid=8.0)
    assert sample.labels is None and np.abs(sample.field).max() > 5


def test_augment_many_states_constant_memory_and_no_files():
    def memory():
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * resource.getpagesize()
    used = []
    for i, sample in enumerate(supine.augment(lungs, ct, labels=labels, states=60, grid=8.0, seed=1, **scan)):
        folder, = glob.glob("supine-*")
        assert sum(entry.stat(follow_symlinks=False).st_size for entry in os.scandir(folder)) < 100 * 1000
        assert all(entry.is_symlink() or entry.name == "pipe" for entry in os.scandir(folder))
        used.append(memory())
    assert i == 59 and used[59] - used[9] < 2 * (ct.nbytes + sample.field.nbytes), used
    assert not glob.glob("supine-*")


def test_augment_stopped_early_ends_program():
    samples = supine.augment(lungs, ct, states=1000, grid=8.0, seed=1, **scan)
    next(samples)
    samples.close()
    assert not glob.glob("supine-*")


def test_augment_wrong_input_message_of_program():
    for wrong, message in ((["pron"], "pron"), (["prone:rest+90000"], "")):
        try:
            list(supine.augment(lungs, ct, states=wrong, grid=8.0, **scan))
        except supine.Error as error:
            assert message in str(error) and str(error)
        else:
            raise AssertionError(wrong)


def test_random_states_documented_distribution():
    drawn = supine.random_states(lungs, 400, 7)
    assert drawn == supine.random_states(lungs, 400, 7)
    count = [sum(state.startswith(posture) for state in drawn) for posture in ("supine", "prone", "left", "right")]
    assert sum(count) == 400 and min(count) > 70
    volumes = [lungs.volumes(lungs.pose(state)).sum() for state in drawn]
    assert min(volumes) > 2500 and max(volumes) < 6700 and np.std(volumes) > 800


def test_deform_called_as_transform_moves_image_and_labels():
    affine = np.diag([-step[0], -step[1], step[2], 1.0])
    affine[:3, 3] = [-low[0], -low[1], low[2]]
    subject = {"image": ct.T[None], "label": labels.T[None], "name": "a"}
    expected, = supine.augment(lungs, ct, labels=labels, states=["prone:rest"], grid=8.0, **scan)
    moved = supine.Deform(lungs, affine=affine, states=["prone:rest"], grid=8.0)(subject)
    assert moved["state"] == "prone:rest" and moved["name"] == "a" and (subject["image"] == ct.T[None]).all()
    assert (moved["image"] == expected.image.T[None]).all() and (moved["label"] == expected.labels.T[None]).all()

    class Image:  # has what images of TorchIO have
        def __init__(self, data):
            self.data, self.affine = data, affine

        def set_data(self, data):
            self.data = data
    both = {"image": Image(ct.T[None]), "label": Image(labels.T[None])}
    again = supine.Deform(lungs, states=["prone:rest"], grid=8.0)(both)
    assert (again["image"].data == moved["image"]).all() and (both["image"].data == ct.T[None]).all()


for name, test in list(globals().items()):
    if name.startswith("test_"):
        test()
        print(name)
