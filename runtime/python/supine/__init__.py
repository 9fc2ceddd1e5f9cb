# SPDX-License-Identifier: MIT
"""Deform lungs by gravity and breathing, at the speed of the C library.

    import supine

    lungs = supine.open("lungs.safetensors")
    pose = lungs.pose("prone:rest+500")        # compute once for each posture and volume
    points = lungs.deform(pose)                # float32 [N, 3], mm, LPS

Lengths are millimetres, volumes millilitres, axes the DICOM patient axes (LPS: +x left, +y posterior,
+z head). A state is a text, as in the program's options: POSTURE, VOLUME or POSTURE:VOLUME, where a
volume is rest, full or scan with +ML or -ML, or absolute, such as 2600mL. Arrays of an open basis are
read-only views of its memory. Calls release the interpreter's lock, so that threads may share one basis,
each with a range of vertices.
"""
from __future__ import annotations

import ctypes
import functools
import gzip
import io
import operator
import os
import tempfile
from typing import Any, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _library as _c
from . import _augment, _program
from ._augment import Deform, Sample, augment, random_states
from ._library import (ArgumentError, Error, FormatError, MeshError, NumericalError, OpenSurfaceError,
                       OutOfMemoryError, ReadError, UnsupportedError)
from ._program import save_fields

__all__ = ["open", "precompute", "save_fields", "embed", "augment", "random_states", "another_day", "Deform", "Sample",
           "Basis", "Pose", "Location", "Target", "Fact", "gravity", "gravity_of_rotation", "tilt", "roll",
           "postures", "breath", "Gravity", "Error", "ArgumentError", "FormatError", "MeshError", "NumericalError",
           "OpenSurfaceError", "OutOfMemoryError", "ReadError", "UnsupportedError"]
__version__: str = _c.string(_c.version())

Gravity = Union[str, Sequence[float], NDArray[np.float64]]
Volume = Union[str, Mapping[str, str]]
Source = Union[str, bytes, bytearray, memoryview, "os.PathLike[str]"]
Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

_FLOAT = np.dtype(np.float32)
STORAGES = ("auto", "exact", "int16", "mixed")
COURSES = ("cosine", "ramp", "flow")
SIMDS = ("auto", "portable", "avx2", "avx512")
_SUPINE = (0.0, 1.0, 0.0)


def _three(gravity: Gravity) -> Any:
    """Convert gravity to a C array. It is given as the name of a posture or as three numbers."""
    if isinstance(gravity, str):
        state = _c.State()
        _c.state_parse_posture(gravity.encode(), state)
        return state.gravity
    return _numbers(gravity, 3, "gravity")


def _numbers(values: ArrayLike, count: int, name: str) -> Any:
    flat = np.asarray(values, np.float64).ravel()
    if flat.size != count:
        raise ValueError(f"{name} must be {count} numbers")
    if not np.isfinite(flat).all():
        raise ArgumentError(f"{name} has a number that is not finite")
    return (ctypes.c_double * count)(*flat)


def gravity(posture: Gravity) -> Doubles:
    """Return gravity in a posture, a unit vector that points where things fall: `gravity("prone")` is (0, -1, 0)."""
    return np.array(_three(posture))


def gravity_of_rotation(rotation: ArrayLike, up: Sequence[float], axes: str = "lps") -> Doubles:
    """Compute gravity for a body that an engine or a headset has rotated.

    rotation: unit quaternion W, X, Y, Z, or matrix [3, 3], from the axes of the body's object to those of the world
    up: direction in the world that points up, such as (0, 1, 0)
    axes: axes of the object: lps, unity, unreal, three or headset (`supine_posture_rotation` in C says where each has
        the patient's left, back and head)
    """
    out = (ctypes.c_double * 3)()
    size = np.size(rotation)
    _c.posture_rotation(_numbers(rotation, size, "rotation"), size, _numbers(up, 3, "up"), axes.encode(), out)
    return np.array(out)


def tilt(posture: Gravity, degrees: float) -> Doubles:
    """Tilt the body by -90 to 90 degrees. + lowers the head of a lying body, and leans an upright one back."""
    out = (ctypes.c_double * 3)()
    status = _c.posture_tilt(_three(posture), degrees, out)
    if status != 0:
        _c.fail(status, b"the tilt must be -90 to 90 degrees")
    return np.array(out)


def roll(posture: Gravity, degrees: float) -> Doubles:
    """Roll the body about its long axis by -180 to 180 degrees, + to its left: supine rolled by 90 degrees is left."""
    out = (ctypes.c_double * 3)()
    status = _c.posture_roll(_three(posture), degrees, out)
    if status != 0:
        _c.fail(status, b"the roll must be -180 to 180 degrees")
    return np.array(out)


def postures() -> tuple[str, ...]:
    """Return the names of all postures."""
    return tuple(_c.string(_c.posture_name(i)) for i in range(_c.posture_count()))


def breath(times: ArrayLike, *, tidal: float = 500.0, rate: float = 12.0, inhale: float = 1 / 3,
           rest_pressure: float = 5.0, course: str = "cosine",
           pv: Optional[ArrayLike] = None) -> Doubles:
    """Compute the volume in mL above rest at times in s, for repeated breaths as in `supine breathe`. The first breath
    begins at time 0.

    tidal: volume of a breath, mL
    rate: breaths per minute
    inhale: fraction of the breath's time that is inhalation
    rest_pressure: pressure at the end of an exhalation, cmH2O
    course: course of the pressure, "cosine" or "ramp", or "flow" for a constant flow
    pv: [2, 9], pressure-volume curves of inhalation and exhalation: P_low, P_high (cmH2O), V_low, V_high (mL) and the
        control parameters c1 to c5, as `supine pv fit` finds them; by default the curves of a normal adult
    """
    times = np.asarray(times, np.float64)
    flat = np.ascontiguousarray(times).ravel()
    volumes = np.empty_like(flat)
    relation = _c.breath_normal() if pv is None else _numbers(pv, 18, "pv")
    _c.breath_evaluate(relation, _c.Breath(tidal, rate, inhale, rest_pressure, COURSES.index(course)), flat.size,
                       flat.ctypes.data, volumes.ctypes.data, None)
    return volumes.reshape(times.shape)


class Pose(_c.CPose):
    """The weights of modes and the gains (factors of displacement) of a state of a basis, made by `Basis.pose`."""
    _made: Optional[tuple[Any, Any]] = None  # the open basis and the direction of gravity

    def __reduce__(self) -> Any:
        return _restore_pose, (bytes(self),)  # without the basis, which is pickled by itself

    def fill(self, gain: float) -> Pose:
        """Multiply all displacements by `gain`. Use this where no volume is known, such as for open surfaces. Volumes
        that lungs cannot hold are refused or told, as by `Basis.pose`."""
        if not np.isfinite(gain):
            raise ArgumentError(f"the gain is {gain}: give a finite number")
        if self._made is not None:
            owner, gravity = self._made
            made = Pose()
            _c.basis_pose_gain(owner.pointer, gravity, gain, made)
            owner.tell(_c.State(gravity), made)
        np.ctypeslib.as_array(self.gains)[:] = gain
        return self


def _restore_pose(content: bytes) -> Pose:
    return Pose.from_buffer_copy(content)


def _address(array: Floats, count: int, name: str, writable: bool = True) -> int:
    """Check an array of `count` float32 numbers that C reads or writes; return its address."""
    if array.dtype is not _FLOAT and array.dtype != _FLOAT or array.size != count:
        raise ValueError(f"{name} must be an array of {count} numbers of type float32")
    if not array.flags.c_contiguous:
        raise ValueError(f"{name} must be contiguous")
    if writable and not array.flags.writeable:
        raise ValueError(f"{name} is read-only")
    return array.__array_interface__["data"][0]


def _state(state: Gravity, volume: Volume = "") -> Any:
    """Convert a state to a C struct. The default posture is supine; the default volume is that of the basis."""
    for text in (state, volume):
        if isinstance(text, (int, float, np.number)):
            raise ArgumentError(f"{text!r} has no unit and no reference: give a text such as '2600mL' or 'rest+500'")
    wanted = _c.State(_SUPINE)
    if isinstance(state, str):
        _c.state_parse(state.encode(), wanted)
    else:
        wanted.gravity = _numbers(state, 3, "gravity")
    if isinstance(volume, Mapping):
        for name, text in volume.items():
            if not isinstance(name, str) or not isinstance(text, str) or not name or set("=,") & set(name + text):
                raise ArgumentError(f"{name!r}: {text!r} is not a lung and its volume: give texts such as "
                                    "{'left': 'rest+500'}")
        volume = ",".join(f"{name}={text}" for name, text in volume.items())
    if not isinstance(volume, str):
        raise ArgumentError(f"the volume is {type(volume).__name__}: give a text such as '2600mL' or 'rest+500'")
    if volume:
        other = _c.State()
        _c.state_parse_volume(volume.encode(), other)
        _c.state_join(wanted, other, wanted)
    return wanted


class _Owner:
    """An open basis of the C library. It is closed when no view of its memory exists any more."""

    def __init__(self, source: Source, options: _c.Options) -> None:
        self.pointer = ctypes.c_void_p()
        self.source = source
        self.allow_folds: bool = options.allow_folds
        if isinstance(source, (bytes, bytearray, memoryview)):
            self.bytes = np.frombuffer(source, np.uint8)  # keep the bytes alive while the basis exists
            _c.basis_open_memory(self.bytes.ctypes.data, self.bytes.size, options, self.pointer)
        else:
            _c.basis_open(os.fsencode(source), options, self.pointer)

    def __del__(self) -> None:
        _c.basis_close(self.pointer)

    def tell(self, state: Any, pose: Pose) -> None:
        """Warn of a pose that lungs cannot hold, if the basis was opened to compute it all the same."""
        if self.allow_folds:
            findings = _c.Findings()
            _c.basis_tell(self.pointer, state, pose, findings)
            _program.warn(_program.told(findings))

    def view(self, data: int, kind: Any, shape: Sequence[int]) -> NDArray[Any]:
        """Return memory of the basis as a read-only array."""
        block = (kind * int(np.prod(shape, dtype=np.int64))).from_address(data or ctypes.addressof(self.pointer))
        block.owner = self
        array = np.frombuffer(block, np.dtype(kind)).reshape(shape)
        array.flags.writeable = False
        return array


class Target(NamedTuple):
    """A named structure: its lung, the mean position `at` of its vertices, the displacement `move` of this position,
    its length `mm`, and the expected errors, mm (3-D RMS; NaN if unknown): of the position, in the session of the scan
    (`expected_error`) and on another day (`another_day_error`), and of the displacement (`moved_error`). Vectors are in
    mm, LPS. `anatomy` is true for a large part, such as airways, vessels or a lobe, of which these are means, and false
    for a target."""
    name: str
    lung: str
    at: Doubles
    move: Doubles
    mm: float
    expected_error: float
    another_day_error: float
    moved_error: float
    anatomy: bool


class Fact(NamedTuple):
    """What a basis assumes or was given: `value` in `unit`, with its range, one standard deviation to either side;
    numbers that there are not are NaN. `text` holds words, such as the state in the scan. `source` is "given",
    "measured", "fitted", "simulated", "assumed", "computed" or "collapsed", and `origin` continues it ("from healthy
    people"). Views of the lungs must name facts with a `caveat`."""
    name: str
    text: str
    value: float
    low: float
    high: float
    unit: str
    source: str
    origin: str
    caveat: bool
    line: str

    def __str__(self) -> str:
        return f"{self.name}: {self.line}"


class Basis:
    """An open basis file, made by `supine.open`. It is closed when nothing uses it any more.

    vertices: float32 [N, 3], reference positions, mm
    triangles: uint32 [M, 3], three vertices of each triangle
    coefficients: float32 [N, K] for K modes, or [N, 3, K] if `vector` is true; if the file stores clusters of vertices
        instead, a new array made from them at the first access
    direction: float32 [N, 3], vector along which each vertex moves, mm; None if `vector` is true
    modes: float64 [K, (band + 1)^2, order + 1], spherical-harmonic coefficients of the weight of each mode, for each
        polynomial of the volume; order is 0 unless the file holds another simulator's fields over volume
    bounds: float32 [lungs, 2, 3], lowest and highest corner of the box around each lung, mm
    lungs: dict from the name of each lung to the slice of its vertices
    metadata: dict from the keys of the file's metadata to the texts
    order: highest degree of the polynomials of a lung's volume in another simulator's fields over gravity and volume;
    if
        it is above 0, each lung has weights of its own
    storage_error: bound on position errors from storage and rounding, for 500 mL above the reference surface, mm
    report: what the program printed when `precompute` or `embed` made the basis
    """
    report: str = ""

    def __init__(self, source: Source, *, storage: str = "auto", simd: str = "auto", normals: bool = True,
                 allow_folds: bool = False) -> None:
        self._options = {"storage": storage, "simd": simd, "normals": normals, "allow_folds": allow_folds}
        options = _c.Options(ctypes.sizeof(_c.Options), STORAGES.index(storage), SIMDS.index(simd), not normals,
                             allow_folds)
        self._owner = _Owner(source, options)
        self._c = self._owner.pointer
        info = _c.basis_get_info(self._c).contents
        self.vertex_count: int = info.vertex_count
        self.triangle_count: int = info.triangle_count
        self._size = 3 * self.vertex_count
        self.mode_count: int = info.mode_count
        self.order: int = info.order
        self.band: int = info.band
        self.vector: bool = info.vector
        self.has_volume: bool = info.has_volume
        self.has_rest: bool = info.has_rest
        self.has_normals: bool = info.normal_count > 0
        self.storage: str = STORAGES[info.storage]
        self.simd: str = SIMDS[info.simd]
        self.storage_error: float = info.storage_error
        count: int = info.lung_count
        self.lungs: dict[str, slice] = {_c.string(info.lung_names[i]): slice(info.lung_begin[i], info.lung_begin[i + 1])
                                        for i in range(count)}
        size = ctypes.c_size_t()
        all_metadata = _c.basis_all_metadata(self._c, size)
        self.metadata: dict[str, str] = {_c.string(all_metadata[i].key): _c.string(all_metadata[i].value)
                                         for i in range(size.value)}
        self.vertices: Floats = self._tensor("vertices")
        self.triangles: NDArray[np.uint32] = self._tensor("triangles")
        self.direction: Optional[Floats] = None if self.vector else self._tensor("direction")
        self.modes: Doubles = self._tensor("modes")
        self.bounds: Floats = self._owner.view(ctypes.cast(info.bounds, ctypes.c_void_p).value or 0, ctypes.c_float,
                                               (count, 2, 3))

    def __reduce__(self) -> Any:
        """Pickle what the basis was opened from: its bytes, or the absolute path of its file. It is opened again where
        it is unpickled, as in the workers of a data loader."""
        source = self._owner.source
        if isinstance(source, (bytearray, memoryview)):
            source = bytes(source)
        elif not isinstance(source, bytes):
            source = os.path.abspath(source)
        return _open, (source, self.report, self._options)

    def __repr__(self) -> str:
        return (f"<supine.Basis: {self.vertex_count} vertices, {self.triangle_count} triangles, "
                f"{self.mode_count} modes, {', '.join(self.lungs)}>")

    def _tensor(self, name: str) -> NDArray[Any]:
        tensor = _c.basis_tensor(self._c, name.encode()).contents
        return self._owner.view(tensor.data, _c.DTYPES[tensor.dtype], tensor.shape[:tensor.rank])

    @functools.cached_property
    def coefficients(self) -> Floats:
        """The displacement of each vertex by each mode; if the file has clusters, a new array made from them."""
        stored: Optional[Floats] = self.tensor("coefficients")
        if stored is not None:
            return stored
        made = np.empty((self.vertex_count, 3, self.mode_count), _FLOAT)
        _c.basis_coefficients(self._c, 0, self.vertex_count, made.ctypes.data)
        return made

    def tensor(self, name: str) -> Optional[NDArray[Any]]:
        """Return a tensor of the file as a view; None if the file has no tensor of that name."""
        return self._tensor(name) if _c.basis_tensor(self._c, name.encode()) else None

    @property
    def facts(self) -> list[Fact]:
        """What the basis assumes and was given, as `supine info` lists it."""
        facts = (_c.Fact * _c.FACTS_MAX)()
        count = _c.basis_facts(self._c, facts)
        line = ctypes.create_string_buffer(320)
        made = []
        for fact in facts[:count]:
            _c.fact_print(fact, line, len(line))
            made.append(Fact(_c.string(fact.name), _c.string(fact.text), fact.value, fact.low, fact.high,
                             _c.string(fact.unit), _c.string(_c.fact_source_name(fact.source)), _c.string(fact.origin),
                             _c.fact_is_caveat(fact), _c.string(line.value)))
        return made

    @property
    def caveats(self) -> str:
        """All facts with a caveat as one line, which views of the lungs must show."""
        line = ctypes.create_string_buffer(1200)
        _c.basis_caveats(self._c, line, len(line))
        return _c.string(line.value)

    @property
    def faces(self) -> NDArray[np.int64]:
        """The triangles as a new array for pyvista.PolyData and vtkCellArray.ImportLegacyFormat. For each triangle, the
        array has the number 3 and three vertices."""
        faces = np.empty((self.triangle_count, 4), np.int64)
        faces[:, 0] = 3
        faces[:, 1:] = self.triangles
        return faces.ravel()

    def pose(self, state: Gravity, volume: Volume = "", out: Optional[Pose] = None) -> Pose:
        """Compute the pose of a state: `pose("prone:rest+500")`, `pose("full-300")` (supine),
        `pose((0, 0.6, -0.8), "rest")`, or with a volume for each lung, `pose("prone", {"left": "rest", "right":
        "2L"})`. The default volume is rest if the basis has a volume at rest. `out` is a pose to write into.
        Warns of a volume that lungs cannot hold, if the basis was opened with `allow_folds`."""
        out = Pose() if out is None else out
        self._judge(_state(state, volume), out)
        return out

    def _judge(self, wanted: Any, pose: Optional[Pose] = None) -> Any:
        """Write the pose of a state, which is refused, or told, if lungs cannot hold it. Return the state."""
        pose = Pose() if pose is None else pose
        _c.basis_pose(self._c, wanted, pose)
        pose._made = self._owner, wanted.gravity
        self._owner.tell(wanted, pose)
        return wanted

    def expected_error(self, state: Gravity, volume: Volume = "", since: Optional[Gravity] = None) -> Floats:
        """Compute the expected error [N] of the vertices in a state, mm (3-D RMS): of their positions in the session of
        the scan, or of their displacements from the state `since`. Half of all points lie within 0.9 times their
        expected error, 95 % within 1.8 times. These errors were measured on full breaths in one posture; for a change
        of posture they are extrapolated. On another day than that of the scan, positions have the error
        `another_day`. Of another simulator's fields, it is the error of the fit to the simulator, which is
        larger in gaps between its directions of gravity, and depends on the volume."""
        return self._expected(self._judge(_state(state, volume)), None if since is None else self._judge(_state(since)))

    def _expected(self, wanted: Any, origin: Any) -> Floats:
        sigma = np.empty(self.vertex_count, _FLOAT)
        _c.expected_error(self._c, wanted, origin, _address(sigma, self.vertex_count, "sigma"))
        return sigma

    def _doubt(self, states: Sequence[Gravity], since: Optional[Gravity], another_day: bool,
               location: Any = None) -> tuple[Any, Any]:
        """Prepare the random field of the expected error; return it, and the memory that it needs."""
        count = max(1, len(states))  # of located lungs, none is given
        space, field = np.empty(_c.doubt_space(self._c, count)), ctypes.c_void_p()
        given = (_c.State * count)(*(self._judge(_state(state)) for state in states))
        origin = None if since is None else ctypes.pointer(self._judge(_state(since)))
        _c.doubt_prepare(_c.DoubtTask(self._c, count, given, origin, another_day, location), space.ctypes.data, field)
        return field, space

    def _covariance(self, field: Any, states: int, vertices: Sequence[int]) -> tuple[Doubles, Doubles]:
        points = [(int(vertex), state) for state in range(states) for vertex in vertices]
        mean = np.empty((states, len(vertices), 3))
        covariance = np.empty(mean.shape + mean.shape)
        _c.doubt_covariance(field, len(points), (_c.DoubtPoint * len(points))(*points), mean.ctypes.data,
                            covariance.ctypes.data)
        return mean, covariance

    def _samples(self, field: Any, count: int, seed: int) -> Floats:
        space, mend = np.empty(_c.doubt_mend_space(self._c)), ctypes.c_void_p()
        _c.doubt_mend_prepare(field, 0, space.ctypes.data, mend)
        made = np.empty((count, self.vertex_count, 3), _FLOAT)
        for index in range(count):
            _c.doubt_sample(field, 0, seed, index, made[index].ctypes.data)
            _c.doubt_mend_sample(mend, made[index].ctypes.data)
        return made

    def covariance(self, vertices: Sequence[int], states: Union[Gravity, Sequence[Gravity]],
                   since: Optional[Gravity] = None,
                   *, another_day: bool = False) -> tuple[Doubles, Doubles]:
        """Compute the predicted positions [S, n, 3] of n vertices in S states, mm, and the covariance [S, n, 3, S, n,
        3] of their errors, mm^2. Errors of neighbours are alike: the error of a distance, of a mean or of a plan
        follows from the covariance, never from `expected_error` alone. After a fit of landmarks, which the basis keeps,
        it is small near them. Equations and evidence: <supine/doubt.h>.

        since: state whose positions are exact, if it is not the scan's
        another_day: whether the lungs are those of another day than the scan"""
        wanted = [states] if isinstance(states, str) else list(states)
        field, _space = self._doubt(wanted, since, another_day)
        return self._covariance(field, len(wanted), vertices)

    def samples(self, state: Gravity, count: int, seed: int = 0, since: Optional[Gravity] = None, *,
                another_day: bool = False) -> Floats:
        """Draw `count` plausible lungs around those computed for a state: positions [count, N, 3], mm. Their spread is
        the expected error, before the best translation is taken out (a factor of 1.15). Lungs, and grids in
        them, have the volumes of the state and no folds; points inside them have no surface, and keep no volume. `seed`
        and the place in the array decide a sample. The numbers are those of `supine deform --samples`."""
        field, _space = self._doubt([state], since, another_day)
        return self._samples(field, count, seed)

    def registration(self, state: Gravity, fiducials: Sequence[int], since: Optional[Gravity] = None, *,
                     another_day: bool = False) -> tuple[Doubles, Doubles, Floats]:
        """Register a state at fiducials, vertices of this basis: at least three, spread around the targets. Return the
        rotation [3, 3] and the translation [3], mm, that move their positions x closest to those in the scan,
        rotation @ x + translation, and the expected error [N] of the vertices that is left after it, mm (3-D RMS): the
        target registration error. The same as `supine deform --frame POINTS`."""
        field, _space = self._doubt([state], since, another_day)
        places = (ctypes.c_size_t * len(fiducials))(*map(int, fiducials))
        space, frame = np.empty(_c.doubt_frame_space(self._c, len(fiducials))), ctypes.c_void_p()
        _c.doubt_frame_prepare(field, len(fiducials), places, space.ctypes.data, frame)
        rotation, translation, sigma = np.empty((3, 3)), np.empty(3), np.empty(self.vertex_count, _FLOAT)
        _c.doubt_frame_motion(frame, rotation.ctypes.data, translation.ctypes.data)
        _c.doubt_frame_errors(frame, 0, self.vertex_count, sigma.ctypes.data)
        return rotation, translation, sigma

    def targets(self, state: Gravity, volume: Volume = "", since: Optional[Gravity] = None) -> list[Target]:
        """Compute where each named structure of a basis made by `embed` is in a state, and how far it has moved from
        the state `since`, or from the scan. The numbers are those of `supine deform -o FILE.csv`."""
        names, part = self.tensor("names"), self.tensor("part")
        if names is None or part is None:
            raise ArgumentError("the basis names no structures: make one with embed")
        pose, origin = Pose(), Pose()
        wanted = self._judge(_state(state, volume), pose)
        was = None if since is None else self._judge(_state(since), origin)
        if since is None:
            _c.basis_scan_pose(self._c, origin)
        after, before = self.deform(pose).astype(np.float64), self.deform(origin).astype(np.float64)
        try:
            sigma: Any = self._expected(wanted, None)
            moved: Any = self._expected(wanted, was)
        except UnsupportedError:
            sigma = moved = np.full(self.vertex_count, np.nan)
        anatomy = self.tensor("anatomy")
        values = np.column_stack([after, after - before, sigma.astype(np.float64) ** 2, moved.astype(np.float64) ** 2])
        names_of = [name for name, lung in self.lungs.items() for _ in range(lung.start, lung.stop)]
        made = []
        for i, name in enumerate(names.tobytes().decode().split("\n")):
            vertices = np.flatnonzero(part == i)
            if vertices.size:
                mean = values[vertices].mean(axis=0)
                made.append(Target(name, names_of[vertices[0]], mean[:3], mean[3:6], float(np.linalg.norm(mean[3:6])),
                                   float(np.sqrt(mean[6])), _c.expected_another_day(float(np.sqrt(mean[6]))),
                                   float(np.sqrt(mean[7])), anatomy is not None and bool(anatomy[i])))
        return made

    @property
    def points(self) -> dict[str, int]:
        """The named points of a basis made by `embed`, as a new dict: name -> index of the vertex."""
        names, part = self.tensor("names"), self.tensor("part")
        if names is None or part is None:
            return {}
        text = names.tobytes().decode().split("\n")
        return {text[name]: int(np.flatnonzero(part == name)[0])
                for name, count in enumerate(np.bincount(part)) if count == 1}

    def locate(self, vertices: Sequence[int], positions: ArrayLike, state: Gravity = _SUPINE, volume: Volume = "", *,
               noise: float = 2.0, rigid: bool = False, sources: Optional[ArrayLike] = None,
               depth: float = 0.0) -> Location:
        """Find the lungs from observed positions of vertices. This basis has these vertices; `embed` usually makes it.

        vertices: index of the vertex of each of the n observed points
        positions: [n, 3] observed positions, mm, in a frame that may be translated from the frame of the basis and,
            if `rigid` is true, rotated
        volume: empty if the volume is unknown and must be found
        noise: standard deviation of a position on each axis, mm; of a line, across it
        sources: [n, 3] places, mm: each point lies on the line from its source through its position, as an X-ray shows
            it; rows of NaN for points whose position is known. Several lines of one vertex are several views
        depth: standard deviation, mm, of the frame's translation along the lines, about 0, if all have one source or
            are parallel; 0 for 20 mm"""
        return Location(self, vertices, positions, _state(state, volume), noise, rigid, sources, depth)

    def warp(self, image: NDArray[Any], states: Union[str, Sequence[str]], *, step: ArrayLike = (1.0, 1.0, 1.0),
             origin: ArrayLike = (0.0, 0.0, 0.0), labels: bool = False, density: bool = False, since: str = "") -> Any:
        """Move an image [z, y, x] of the scan into a state, or into each of a list of states, by the program `supine`.
        This basis must be a grid (`embed` with grid=...). Return an image on the same voxels and of the same type;
        for a list of states, a list of images.

        step: distances (x, y, z) from voxel to voxel, mm; or a vector for each of the three axes, [3, 3], mm, LPS
        origin: centre of the first voxel, mm, LPS
        labels: whether to take the nearest voxel instead of interpolating, as label maps need
        density: whether to scale densities by the change of volume, so that mass is kept
        since: state of the image, if it is not that of the scan
        """
        image = np.asarray(image)
        image = np.ascontiguousarray(image, image.dtype.newbyteorder("<"))
        header = _augment.nrrd(image, step, origin)
        wanted = [states] if isinstance(states, str) else list(states)
        with tempfile.TemporaryDirectory() as folder:
            basis, scan, table = (os.path.join(folder, name) for name in ("basis", "scan.nrrd", "states.csv"))
            source = self._owner.source
            if isinstance(source, (bytes, bytearray, memoryview)):
                with io.open(basis, "wb") as file:
                    file.write(source)
            else:
                basis = os.path.abspath(os.fsdecode(source))
            with io.open(scan, "wb") as file:
                file.write(header)
                file.write(image.data)
            with io.open(table, "wb") as file:
                file.write(_program.table([["posture", "output"],
                                           *([state, f"{i}.nrrd"] for i, state in enumerate(wanted))]))
            options = {"states": table, "labels" if labels else "image": scan, "density": density,
                       "from": since or None}
            _program.run("deform", [basis], options, {basis: "basis", scan: "image"}, None)
            moved = []
            for i in range(len(wanted)):
                with io.open(os.path.join(folder, f"{i}.nrrd"), "rb") as file:
                    voxels = gzip.decompress(file.read().split(b"\n\n", 1)[1])
                moved.append(np.frombuffer(voxels, image.dtype).reshape(image.shape).copy())
        return moved[0] if isinstance(states, str) else moved

    def weights(self, pose: Pose) -> Doubles:
        """Return a view of the weights of a pose, one for each mode. In a basis of another simulator's fields over
        gravity and volume (`order` above 0), each lung has weights of its own: [lungs, modes]."""
        shape = (len(self.lungs), self.mode_count) if self.order > 0 else (self.mode_count,)
        return np.ctypeslib.as_array(pose.weights)[:int(np.prod(shape))].reshape(shape)

    def gains(self, pose: Pose) -> Doubles:
        """Return a view of the gains [lungs, 3] of a pose: factors of each lung's displacement along x, y and z."""
        return np.ctypeslib.as_array(pose.gains)[:len(self.lungs)]

    def volumes(self, pose: Pose) -> Doubles:
        """Compute the volume (gas and tissue) of each lung in a pose, mL."""
        volumes = np.empty(len(self.lungs))
        _c.basis_volumes(self._c, pose, volumes.ctypes.data)
        return volumes

    def error(self, pose: Pose) -> float:
        """Return a bound, mm, on the position error that storage and rounding cause for any vertex in a pose."""
        return _c.basis_error(self._c, pose)

    def _range(self, begin: int, end: Optional[int]) -> tuple[int, int]:
        end = self.vertex_count if end is None else end
        if not 0 <= begin <= end <= self.vertex_count:
            raise IndexError(f"vertices {begin} to {end}: the range must lie within 0 to {self.vertex_count}")
        return end, 3 * (end - begin)

    def deform(self, pose: Pose, out: Optional[Floats] = None, begin: int = 0, end: Optional[int] = None) -> Floats:
        """Compute the positions [N, 3], mm, of all vertices, or of those in a range; write them into `out` if given."""
        end, size = self._range(begin, end)
        out = np.empty((end - begin, 3), _FLOAT) if out is None else out
        _c.deform_range(self._c, pose, begin, end, _address(out, size, "out"))
        return out

    def displace(self, pose: Pose, out: Optional[Floats] = None, begin: int = 0, end: Optional[int] = None) -> Floats:
        """Compute the displacements [N, 3] from the reference surface, mm. Parameters: as `deform`."""
        end, size = self._range(begin, end)
        out = np.empty((end - begin, 3), _FLOAT) if out is None else out
        _c.displace_range(self._c, pose, begin, end, _address(out, size, "out"))
        return out

    def deform_lit(self, pose: Pose, out: Optional[Floats] = None, normals: Optional[Floats] = None,
                   begin: int = 0, end: Optional[int] = None) -> tuple[Floats, Floats]:
        """Compute positions and unit normals: from vectors in the file if it `has_normals`, or else from the
        triangles."""
        end, size = self._range(begin, end)
        out = np.empty((end - begin, 3), _FLOAT) if out is None else out
        normals = np.empty((end - begin, 3), _FLOAT) if normals is None else normals
        _c.deform_lit_range(self._c, pose, begin, end, _address(out, size, "out"), _address(normals, size, "normals"))
        return out, normals

    def deform_batch(self, poses: Sequence[Pose], out: Optional[Floats] = None, begin: int = 0,
                     end: Optional[int] = None) -> Floats:
        """Compute the positions [T, N, 3], mm, in each of T poses."""
        count = len(poses)
        end, size = self._range(begin, end)
        out = np.empty((count, end - begin, 3), _FLOAT) if out is None else out
        _c.deform_batch(self._c, count, (_c.CPose * count)(*poses), begin, end, _address(out, count * size, "out"))
        return out

    def normals(self, xyz: Floats, out: Optional[Floats] = None) -> Floats:
        """Compute the unit normals [N, 3] of a deformed surface from its triangles."""
        out = np.empty((self.vertex_count, 3), _FLOAT) if out is None else out
        if not np.isfinite(np.asarray(xyz)).all():
            raise ArgumentError("xyz has a number that is not finite")
        _c.normals(self._c, _address(xyz, self._size, "xyz", False), _address(out, self._size, "out"))
        return out


class Location:
    """The result of `Basis.locate`: lungs found from observed points.

    volume, volume_error: volume of all lungs and its standard deviation, mL (0 if the volume was given)
    rotation, translation: observed = rotation @ (predicted position + correction) + translation
    distances: [n] distance of each point from its prediction by all other points, mm
    sigmas: [n] expected RMS of each distance, mm
    outliers: [n] True for outliers, which the result ignores
    depth_error: standard deviation of the translation along one view, mm; 0 if several views or points fix it
    log_evidence: log likelihood, to compare results that differ only in the posture
    """

    def __init__(self, inside: Basis, vertices: Sequence[int], positions: ArrayLike, state: Any, noise: float,
                 rigid: bool, sources: Optional[ArrayLike] = None, depth: float = 0.0) -> None:
        places = np.asarray(positions, np.float64).reshape(-1, 3)
        count = len(places)
        start = np.full((count, 3), np.nan) if sources is None else np.asarray(sources, np.float64).reshape(-1, 3)
        if len(start) != count:
            raise ValueError(f"the number of sources, {len(start)}, is not the number of positions, {count}")
        if len(vertices) != count:
            raise ValueError(f"the number of vertices, {len(vertices)}, is not the number of positions, {count}")
        seen = (_c.Observation * max(count, 1))(*((operator.index(v), tuple(p), noise, not np.isnan(s).all(), tuple(s))
                                                  for v, p, s in zip(vertices, places, start, strict=True)))
        residuals = (_c.Residual * max(count, 1))()
        self._space = np.empty(_c.locate_space(count))  # memory that the C library uses in later calls
        self._c = ctypes.c_void_p()
        task = _c.LocateTask(inside._c, count, seen, state, rigid, depth)
        _c.locate(task, residuals, self._space.ctypes.data, self._c)
        info = _c.location_info(self._c).contents
        findings = _c.Findings()
        _c.location_check(info, findings)
        _program.warn(_program.told(findings))
        self.volume: float = info.volume
        self.volume_error: float = info.volume_error
        self.rotation: Doubles = np.array(info.rotation).reshape(3, 3)
        self.translation: Doubles = np.array(info.translation)
        self.log_evidence: float = info.log_evidence
        self.depth_error: float = info.depth_error
        self.distances: Doubles = np.array([r.distance for r in residuals])
        self.sigmas: Doubles = np.array([r.sigma for r in residuals])
        self.outliers: NDArray[np.bool_] = np.array([r.outlier for r in residuals])

    def __reduce__(self) -> Any:
        raise TypeError("a location cannot be pickled, as it refers to memory of the C library: pickle the observed "
                        "positions")

    def positions(self, basis: Basis) -> tuple[Floats, Floats]:
        """Compute the positions [N, 3] of the vertices of `basis` in the frame of the observations, and their expected
        errors [N], mm. `basis` must be of the same lungs."""
        xyz, sigma = np.empty((basis.vertex_count, 3), _FLOAT), np.empty(basis.vertex_count, _FLOAT)
        _c.locate_positions(self._c, basis._c, xyz.ctypes.data, sigma.ctypes.data)
        return xyz, sigma

    def covariance(self, basis: Basis, vertices: Sequence[int]) -> tuple[Doubles, Doubles]:
        """Compute the positions [n, 3] of n vertices of `basis` in the frame of the observations, mm, and the
        covariance [n, 3, n, 3] of their errors, mm^2, as `Basis.covariance` does: given the observed points."""
        field, _space = basis._doubt([], None, False, self._c)
        mean, covariance = basis._covariance(field, 1, vertices)
        return mean[0], covariance[0, :, :, 0]

    def samples(self, basis: Basis, count: int, seed: int = 0) -> Floats:
        """Draw `count` plausible positions [count, N, 3] of the vertices of `basis`, mm, in the frame of the
        observations, as `Basis.samples` does. They pass near the observed points, within their noise. Surfaces have the
        volume that was given; where it was fitted, they differ in it."""
        field, _space = basis._doubt([], None, False, self._c)
        return basis._samples(field, count, seed)


def another_day(same_session: ArrayLike) -> Doubles:
    """Return the expected errors of positions on another day than that of the scan, mm, from those in its session."""
    return np.hypot(np.asarray(same_session, np.float64), _c.expected_another_day(0.0))


def open(source: Source, *, storage: str = "auto", simd: str = "auto", normals: bool = True,
         allow_folds: bool = False) -> Basis:
    """Open a basis file, given by its path or its bytes, and check all of it.

    storage: kind of numbers in memory: "exact", "int16", "mixed"; or "auto", the smallest with an error of at most
        0.005 mm
    simd: instruction set: "portable", "avx2", "avx512"; or "auto", the widest set of this processor
    normals: False ignores the file's normals, to save memory
    allow_folds: True computes poses with volumes that lungs cannot hold, or at which the surface folds, instead of
        refusing them
    """
    return Basis(source, storage=storage, simd=simd, normals=normals, allow_folds=allow_folds)


def precompute(*surfaces: Any, progress: Optional[_program.Progress] = None, **options: Any) -> Basis:
    """Make a basis from lung surfaces. Use the offline library (GPL) if it is installed, else the program `supine`,
    beside this package or on PATH. Examples:

        precompute(vertices, faces, scanned="supine:rest")      # vertices [N, 3], faces [M, 3] of one lung or both
        precompute((vertices, faces), (vertices, faces))        # one surface for each lung
        precompute("lungs.nii.gz", resting={"supine": "2600mL"}, output="lungs.safetensors")
        precompute(vertices, faces, fields=(points, gravity, displacement))  # of another simulator: `save_fields`

    The basis has the vertices of the left lung first, and the vertices of each lung in the given order. Options are
    those of `supine precompute --help`: held_out=200 becomes --held-out 200. The value True becomes a flag, a tuple
    becomes a,b,c and a dict becomes a=b,c=d; a list repeats the option. Without `output`, the basis is only in
    memory. Warnings become Python warnings.

    progress: function that is called with the fraction done, 0 to 1. If it raises an exception, the work stops.
    """
    if len(surfaces) == 2 and not isinstance(surfaces[0], (str, tuple, os.PathLike)):
        surfaces = (surfaces,)
    return _open(*_program.precompute(surfaces, options, progress))


def embed(lungs: Basis, *content: Any, progress: Optional[_program.Progress] = None, **options: Any) -> Basis:
    """Make a basis of structures that are inside the lungs of a basis and move with them. Examples:

        embed(lungs, {"nodule": (-80, -120, -90)})              # named points; or an array [n, 3] of points
        embed(lungs, (vertices, faces), "airways.ply")          # a mesh from arrays, and one from a file
        embed(lungs, "labels.nii.gz", labels="7=nodule")        # an image of labels

    Options are those of `supine embed --help`, given as in `precompute`, with the same `output` and `progress`."""
    return _open(*_program.make("embed", lungs._owner.source, content, options, progress))


def _open(source: Source, report: str, options: Optional[dict[str, Any]] = None) -> Basis:
    basis = Basis(source, **(options or {}))
    basis.report = report
    return basis
