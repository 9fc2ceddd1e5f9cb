# SPDX-License-Identifier: MIT
"""Training data: lungs in many states, with their CT, labels, points and displacement field, as arrays in memory."""
from __future__ import annotations

import contextlib
import copy
import fcntl
import os
import re
import select
import subprocess
import tempfile
from dataclasses import dataclass
from typing import Any, Iterator, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _library as _c
from . import _program

VOXELS = {"int8": "int8", "uint8": "uint8", "int16": "int16", "uint16": "uint16", "int32": "int32", "uint32": "uint32",
          "float32": "float", "float64": "double"}
_NIFTI = {2: "u1", 256: "i1", 4: "i2", 512: "u2", 8: "i4", 768: "u4", 16: "f4", 64: "f8"}


@dataclass
class Sample:
    """The lungs in one state.

    state: posture and volume, such as "prone+4.0:rest+350"
    image, labels: moved image and label map [z, y, x], on the voxels of the given ones; None if not given
    points: moved points [n, 3], mm, LPS, in the order given, and points_error [n], their expected errors, mm; None if
        not given
    field: displacement [z, y, x, 3] of the tissue at the nodes of a grid in the scan, mm, LPS
    field_origin, field_step: first node of the grid, and the distances (x, y, z) between nodes, mm, LPS
    error: expected error [z, y, x] of the field, mm (3-D RMS); NaN at nodes far from the lungs"""
    state: str
    image: Optional[NDArray[Any]]
    labels: Optional[NDArray[Any]]
    points: Optional[NDArray[np.float32]]
    points_error: Optional[NDArray[np.float32]]
    field: NDArray[np.float32]
    field_origin: NDArray[np.float64]
    field_step: NDArray[np.float64]
    error: NDArray[np.float32]


def random_states(lungs: Any, count: int, seed: Any = None) -> list[str]:
    """Draw states: the posture is supine, prone, left or right, each with probability 1/4; gravity is tilted towards
    the head or the feet by an angle with a normal distribution (SD 10 degrees, redrawn beyond 30); the volume is
    uniform between rest and full inflation in this posture. `seed` is an integer or a numpy Generator."""
    number, states = np.random.default_rng(seed), []
    for _ in range(count):
        posture, degrees = ("supine", "prone", "left", "right")[number.integers(4)], np.inf
        while abs(degrees) > 30:
            degrees = number.normal(0, 10)
        posture = f"{posture}{degrees:+.1f}"
        rest, full = (lungs.volumes(lungs.pose(posture, volume)).sum() for volume in ("rest", "full"))
        states.append(f"{posture}:rest+{number.uniform(0, full - rest):.0f}")
    return states


def nrrd(image: NDArray[Any], step: ArrayLike, origin: ArrayLike) -> bytes:
    """Make the header of a raw NRRD file; the voxels follow it."""
    if image.ndim != 3 or image.dtype.name not in VOXELS:
        raise ValueError(f"image must be an array [z, y, x] of {', '.join(VOXELS)}")
    steps = np.asarray(step, np.float64)
    if steps.shape not in ((3,), (3, 3)) or np.shape(origin) != (3,):
        raise ValueError(f"step must be [3] or [3, 3], and origin [3], not {list(steps.shape)} and "
                         f"{list(np.shape(origin))}")
    numbers = [f"({','.join(repr(float(x)) for x in row)})"
               for row in [*(np.diag(steps) if steps.ndim == 1 else steps), np.asarray(origin)]]
    return (f"NRRD0004\ntype: {VOXELS[image.dtype.name]}\ndimension: 3\nspace: left-posterior-superior\n"
            f"sizes: {' '.join(map(str, image.shape[::-1]))}\nspace directions: {' '.join(numbers[:3])}\n"
            f"space origin: {numbers[3]}\nendian: little\nencoding: raw\n\n").encode()


def _in_memory(stack: contextlib.ExitStack, folder: str, name: str, *parts: Any) -> str:
    """Put bytes into a file in memory, and return a path to it."""
    file = stack.enter_context(os.fdopen(os.memfd_create(name), "wb"))
    for part in parts:
        file.write(part)
    file.flush()
    path = os.path.join(folder, name)
    os.symlink(f"/proc/{os.getpid()}/fd/{file.fileno()}", path)
    return path


class _Pipe:
    """Reads the images that the program writes one after another."""

    def __init__(self, folder: str, process: subprocess.Popen[bytes], said: Any) -> None:
        self.folder, self.process, self.said = folder, process, said
        self.fd = os.open(os.path.join(folder, "pipe"), os.O_RDWR)
        fcntl.fcntl(self.fd, fcntl.F_SETPIPE_SZ, 1 << 20)

    def read(self, data: NDArray[Any]) -> NDArray[Any]:
        view, at = memoryview(data).cast("B"), 0
        while at < len(view):
            if select.select([self.fd], [], [], 0.1)[0]:
                at += os.readv(self.fd, [view[at:at + (1 << 20)]])
            elif self.process.poll() is not None and not select.select([self.fd], [], [], 0)[0]:
                _program.fail("deform", self.process.returncode, self.heard())
        return data

    def heard(self) -> str:
        """Return what the program has said, of `image`, `labels` and `states` instead of their files. It goes on
        writing to the same file, whose position must stay."""
        said = os.pread(self.said.fileno(), 1 << 20, 0).decode(errors="replace")
        return re.sub(re.escape(self.folder) + r"/(\w+)\.(nrrd|csv)", r"\1", said)

    def image(self) -> NDArray[Any]:
        """Read a NIfTI image [z, y, x], or [3, z, y, x] for a field."""
        head = self.read(np.empty(352, np.uint8)).tobytes()
        size = np.frombuffer(head, "<i2", 8, 40)
        shape = tuple(int(n) for n in ((size[5],) if size[0] == 5 else ()) + tuple(size[3:0:-1]))
        return self.read(np.empty(shape, "<" + _NIFTI[int(np.frombuffer(head, "<i2", 1, 70)[0])]))


def augment(lungs: Any, image: Optional[NDArray[Any]] = None, *, labels: Optional[NDArray[Any]] = None,
            points: Any = None, states: Union[int, str, Sequence[str]] = 100, step: ArrayLike = (1.0, 1.0, 1.0),
            origin: ArrayLike = (0.0, 0.0, 0.0),
            grid: float = 4.0, density: bool = True, rigid: Sequence[int] = (), seed: Any = None) -> Iterator[Sample]:
    """Move a CT, a label map and points of the scan into each of many states. The program `supine` reads them once and
    sends each state through a pipe, when it is asked for: nothing is written to a disk, and the memory does not grow
    with the number of states. Needs Linux.

        for sample in supine.augment(lungs, image=ct, labels=masks, points=nodules, states=1000, seed=1):
            train(sample.image, sample.labels)

    lungs: basis of the scan
    image, labels: arrays [z, y, x] on the same voxels; densities need Hounsfield units
    points: named points, an array [n, 3] in mm and LPS, or files, as for `embed`
    states: a text such as "prone:rest+300", a list of texts, or the number of states that random_states draws with
        `seed`
    step, origin: distances (x, y, z) between voxels, or a vector for each axis [3, 3], and the first voxel; mm, LPS
    grid: distance between the nodes of the displacement field, mm
    density: whether to scale the density of aerated tissue by the change of volume, so that mass is kept; nodules and
        tumours of 1 to 30 mL in the CT then keep their size and shape
    rigid: values of labels of parts that keep their size and shape, such as tumours, whatever their size"""
    if rigid and labels is None:
        raise ValueError("rigid names values of labels: give labels")
    from . import embed  # the package imports this module

    image, labels = (None if array is None else np.asarray(array) for array in (image, labels))
    if image is not None and labels is not None and image.shape != labels.shape:
        raise _c.ArgumentError(f"the shapes of image and labels differ, {image.shape} and {labels.shape}: give both "
                               f"on the same voxels")
    states = [states] if isinstance(states, str) else states
    wanted = random_states(lungs, states, seed) if isinstance(states, int) else list(states)
    inside = None if points is None else embed(lungs, points)
    # a basis groups points by lung
    order = None if inside is None else np.argsort(inside.tensor("part"), kind="stable")
    nodes = embed(lungs, grid=grid)
    frame, shape = nodes.tensor("grid"), tuple(int(n) for n in nodes.tensor("grid_size"))[::-1]
    place = np.rint((nodes.vertices - frame[0]) @ np.linalg.inv(frame[1:])).astype(int)
    given = {"image": image, "labels": labels}
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="supine-"))  # of links and pipes
        basis = _in_memory(stack, folder, "grid.safetensors", nodes._owner.source)
        options: dict[str, Any] = {"density": density and image is not None}
        if rigid:
            options["rigid"] = tuple(rigid)
        for name, array in given.items():
            if array is not None:
                array = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
                options[name] = _in_memory(stack, folder, name + ".nrrd", nrrd(array, step, origin), array.data)
        # Every output is a name of one pipe: fields and images come in the order in which the program writes them.
        os.mkfifo(os.path.join(folder, "pipe"))
        columns = [["output"], ["output", "field"],
                   ["output", "labels", "field"]][(image is not None) + (labels is not None)]
        rows = [["posture", *columns]]
        for i, state in enumerate(wanted):
            outputs = [f"{i}-{column}.nii" for column in columns]
            for output in outputs:
                os.symlink("pipe", os.path.join(folder, output))
            rows.append([state, *outputs])
        options["states"] = _in_memory(stack, folder, "states.csv", _program.table(rows))
        said = stack.enter_context(os.fdopen(os.memfd_create("said"), "w+b"))
        process = subprocess.Popen([_program.find(), "deform", *_program.words(options), "--", basis],
                                   stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=said)
        stack.callback(process.wait)
        stack.callback(process.terminate)
        pipe = _Pipe(folder, process, said)
        stack.callback(os.close, pipe.fd)
        for i, state in enumerate(wanted):
            field = np.ascontiguousarray(np.moveaxis(pipe.image(), 0, -1))
            moved = {name: pipe.image() for name, array in given.items() if array is not None}
            if i == 0:
                _program.warn(_program.warnings_of("deform", pipe.heard()))
            error = np.full(shape, np.nan, np.float32)
            error[place[:, 2], place[:, 1], place[:, 0]] = nodes.expected_error(state)
            yield Sample(state, moved.get("image"), moved.get("labels"),
                         None if inside is None else inside.deform(inside.pose(state))[order],
                         None if inside is None else inside.expected_error(state)[order],
                         field, frame[0].copy(), np.diag(frame[1:]).copy(), error)


class Deform:
    """Moves the scan of a subject into a random state each time it is called: `subject = transform(subject)`.

    A subject is a mapping, as for the dictionary transforms of MONAI (arrays or tensors [channel, x, y, z], or [x, y,
    z]), or a Subject of TorchIO (images with `data` and `set_data`). Neither package is imported. The copy that is
    returned has the moved image and labels, and `state`, the state that was drawn.

    lungs: basis of this subject's scan
    image, label: keys of the CT and of the label map; None if there is none
    affine: voxel to mm, RAS [4, 4], for arrays that have no attribute `affine`
    states: states to draw from, or None for those of random_states; `seed`, `grid` and `density`: as in `augment`"""

    def __init__(self, lungs: Any, image: Optional[str] = "image", label: Optional[str] = "label", *,
                 affine: Any = None, states: Optional[Sequence[str]] = None, grid: float = 4.0, density: bool = True,
                 seed: Any = None) -> None:
        self.lungs, self.image, self.label, self.affine, self.states = lungs, image, label, affine, states
        self.options = {"grid": grid, "density": density}
        self.number = np.random.default_rng(seed)

    def __call__(self, subject: Any) -> Any:
        keys = {name: key for name, key in (("image", self.image), ("labels", self.label)) if key is not None
                and key in subject}
        affine, arrays = self.affine, {}
        for name, key in keys.items():
            item = subject[key]
            affine = getattr(item, "affine", affine)
            voxels = np.asarray(item.data if hasattr(item, "set_data") else item)
            if voxels.ndim == 4 and voxels.shape[0] != 1:
                raise ValueError(f"{key}: {voxels.shape[0]} channels; a scan has 1")
            arrays[name] = np.ascontiguousarray(voxels.reshape(voxels.shape[-3:]).T)
        if affine is None:
            raise ValueError("the position of the voxels is unknown: give affine, voxel to mm, RAS [4, 4]")
        lps = np.diag([-1, -1, 1, 1]) @ np.asarray(affine, float)
        state = random_states(self.lungs, 1,
                              self.number)[0] if self.states is None else str(self.number.choice(self.states))
        sample, = augment(self.lungs, states=[state], step=lps[:3, :3].T, origin=lps[:3, 3], **arrays, **self.options)
        result = copy.copy(subject)
        for name, key in keys.items():
            item = subject[key]
            old = item.data if hasattr(item, "set_data") else item
            moved = np.ascontiguousarray(getattr(sample, name).T).reshape(old.shape)
            new = old.new_tensor(moved) if hasattr(old, "new_tensor") else moved
            if hasattr(item, "set_data"):
                result[key] = copy.copy(item)
                result[key].set_data(new)
            else:
                result[key] = new
        result["state"] = state
        return result
