# SPDX-License-Identifier: MIT
"""Lungs that sag and breathe, at the C library's speed.

    import supine

    lungs = supine.open("lungs.safetensors")
    weights = lungs.weights("prone")                               # once a posture
    scale = lungs.scale(weights, lungs.resting_volume("prone") + 500)
    points = lungs.deform(weights, scale)                          # float32 [N, 3], mm, LPS

Lengths are millimetres, volumes millilitres, axes the DICOM patient axes (LPS: +x left, +y posterior,
+z head). Gravity is a posture's name or three numbers that point where things fall. Arrays of an open
basis are views of its memory, read-only. Calls that visit every vertex release the interpreter's
lock, so that threads may share one basis, each with a range of vertices.
"""
from __future__ import annotations

import os
from typing import Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _supine
from ._supine import (ArgumentError, Error, FormatError, MeshError, NumericalError, OpenSurfaceError,
                      OutOfMemoryError, ReadError, UnsupportedError)

__all__ = ["open", "Basis", "gravity", "gravity_of_quaternion", "tilt", "postures", "breath", "Gravity", "Error",
           "ArgumentError", "FormatError", "MeshError", "NumericalError", "OpenSurfaceError",
           "OutOfMemoryError", "ReadError", "UnsupportedError"]
__version__: str = _supine.version

Gravity = Union[str, Sequence[float], NDArray[np.float64]]
Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

_FLOAT = np.dtype(np.float32)
STORAGES = ("auto", "exact", "int16", "mixed")
COURSES = ("cosine", "ramp", "flow")
SIMDS = ("auto", "portable", "avx2", "avx512")


def gravity(posture: Gravity) -> Doubles:
    """The unit vector, where things fall, of a posture: `gravity("prone")` is (0, -1, 0)."""
    return np.array(_supine.gravity(posture))


def gravity_of_quaternion(quaternion: Sequence[float]) -> Doubles:
    """Gravity of a body that W, X, Y, Z turns from its own axes into a world whose z points up."""
    return np.array(_supine.quaternion(quaternion))


def tilt(posture: Gravity, degrees: float) -> Doubles:
    """Gravity turned in the sagittal plane: supine by +15 degrees is head down."""
    return np.array(_supine.tilt(posture, degrees))


def postures() -> tuple[str, ...]:
    """Every posture's name."""
    return _supine.postures()


def breath(times: ArrayLike, *, tidal: float = 500.0, rate: float = 12.0, inhale: float = 1 / 3,
           rest_pressure: float = 5.0, course: str = "cosine",
           pv: Optional[ArrayLike] = None) -> Doubles:
    """mL above rest at times in s, as `supine breathe` breathes; a breath begins at 0.

    rate           breaths a minute
    inhale         share of the breath's time that is inhalation
    rest_pressure  cmH2O at the end of an exhalation
    course         of the pressure: "cosine", "ramp"; "flow" is a constant flow
    pv             [2, 9], inhale and exhale: P_low, P_high (cmH2O), V_low, V_high (mL) and c1 to c5, as
                   `supine pv fit` finds them; a normal adult's by default
    """
    times = np.asarray(times, np.float64)
    flat = np.ascontiguousarray(times).ravel()
    volumes = np.empty_like(flat)
    relation = None if pv is None else np.ascontiguousarray(pv, np.float64)
    _supine.breath(tidal, rate, inhale, rest_pressure, COURSES.index(course), relation, flat.size, flat,
                   volumes)
    return volumes.reshape(times.shape)


class Basis:
    """An open basis file; `supine.open` makes it. It is released when nothing uses it any more.

    vertices      float32 [N, 3], the file's surface, mm
    triangles     uint32 [M, 3]
    coefficients  float32 [N, K], or [N, 3, K] where `vector`
    direction     float32 [N, 3]; None where `vector`
    modes         float64 [K, (band + 1)^2]
    bounds        float32 [G, 2, 3], each lung's box
    lungs         the vertices of each lung: name -> slice
    metadata      the file's own words: key -> text
    storage_error mm, the bound on what compact storage costs a breath of 500 mL
    """

    def __init__(self, source: Union[str, bytes, bytearray, memoryview, os.PathLike[str]], *,
                 storage: str = "auto", simd: str = "auto", normals: bool = True) -> None:
        self._c = _supine.Basis(source, STORAGES.index(storage), SIMDS.index(simd), normals)
        info = self._c.info()
        self.vertex_count: int = info["vertex_count"]
        self.triangle_count: int = info["triangle_count"]
        self._shape = (self.vertex_count, 3)
        self.mode_count: int = info["mode_count"]
        self.band: int = info["band"]
        self.vector: bool = info["vector"]
        self.has_volume: bool = info["has_volume"]
        self.has_normals: bool = info["normal_count"] > 0
        self.scan_volume: float = info["scan_volume"]
        self.storage: str = STORAGES[info["storage"]]
        self.simd: str = SIMDS[info["simd"]]
        self.storage_error: float = info["storage_error"]
        begin = info["lung_begin"]
        self.lungs: dict[str, slice] = {name: slice(begin[i], begin[i + 1])
                                        for i, name in enumerate(info["lung_names"])}
        self.metadata: dict[str, str] = self._c.metadata()
        self.vertices: Floats = np.asarray(self._c.tensor("vertices"))
        self.triangles: NDArray[np.uint32] = np.asarray(self._c.tensor("triangles"))
        self.coefficients: Floats = np.asarray(self._c.tensor("coefficients"))
        self.direction: Optional[Floats] = None if self.vector else self.tensor("direction")
        self.modes: Doubles = np.asarray(self._c.tensor("modes"))
        self.bounds: Floats = np.asarray(self._c.bounds())

    def __repr__(self) -> str:
        return (f"<supine.Basis: {self.vertex_count} vertices, {self.triangle_count} triangles, "
                f"{self.mode_count} modes, {', '.join(self.lungs)}>")

    def tensor(self, name: str) -> Optional[NDArray[np.generic]]:
        """Any tensor of the file as a view; None where it has none of that name."""
        block = self._c.tensor(name)
        return None if block is None else np.asarray(block)

    @property
    def faces(self) -> NDArray[np.int64]:
        """Triangles as pyvista.PolyData and vtkCellArray.ImportLegacyFormat take them: 3, a, b, c,
        3, ...; made anew."""
        faces = np.empty((self.triangle_count, 4), np.int64)
        faces[:, 0] = 3
        faces[:, 1:] = self.triangles
        return faces.ravel()

    def weights(self, gravity: Gravity, out: Optional[Doubles] = None) -> Doubles:
        """Weights [K] of the modes: once a posture."""
        if out is None:
            out = np.empty(self.mode_count)
        self._c.weights(gravity, out)
        return out

    def resting_volume(self, gravity: Gravity) -> float:
        """mL beyond the file's surface at the end of a quiet expiration in that posture."""
        return self._c.resting_volume(gravity)

    def scale(self, weights: ArrayLike, volume: float, lung: Optional[int] = None) -> float:
        """The breath scale at which the lungs, or one of them, hold `volume` mL beyond the file's
        surface."""
        return self._c.scale(weights, volume, lung)

    def volume(self, weights: ArrayLike, scale: float, lung: Optional[int] = None) -> float:
        """mL beyond the file's surface at a breath scale: the inverse of `scale`."""
        return self._c.volume(weights, scale, lung)

    def error(self, weights: ArrayLike, scales: Union[float, ArrayLike]) -> float:
        """Bound, mm, on what storage and rounding cost any vertex there."""
        return self._c.error(weights, scales)

    def _range(self, begin: int, end: Optional[int], out: Optional[Floats]) -> tuple[int, Floats]:
        end = self.vertex_count if end is None else end
        return end, np.empty((max(end - begin, 0), 3), _FLOAT) if out is None else out

    def deform(self, weights: ArrayLike, scales: Union[float, ArrayLike], out: Optional[Floats] = None,
               begin: int = 0, end: Optional[int] = None) -> Floats:
        """Positions [N, 3] of the vertices, or of those in a range; into `out`, where it is given.

        scales: one number, or one a lung."""
        if end is None:
            end = self.vertex_count
        if out is None:  # most calls: half a microsecond less than _range
            shape = self._shape if end - begin == self.vertex_count else (max(end - begin, 0), 3)
            out = np.empty(shape, _FLOAT)
        self._c.deform(weights, scales, begin, end, out)
        return out

    def displace(self, weights: ArrayLike, scales: Union[float, ArrayLike],
                 out: Optional[Floats] = None, begin: int = 0, end: Optional[int] = None) -> Floats:
        """Displacements [N, 3] from the file's surface, as `deform`."""
        end, out = self._range(begin, end, out)
        self._c.displace(weights, scales, begin, end, out)
        return out

    def deform_lit(self, weights: ArrayLike, scales: Union[float, ArrayLike],
                   out: Optional[Floats] = None, normals: Optional[Floats] = None,
                   begin: int = 0, end: Optional[int] = None) -> tuple[Floats, Floats]:
        """Positions and unit normals, without a look at triangles; needs `has_normals`."""
        end, out = self._range(begin, end, out)
        _, normals = self._range(begin, end, normals)
        self._c.deform_lit(weights, scales, begin, end, out, normals)
        return out, normals

    def deform_batch(self, weights: ArrayLike, scales: ArrayLike, out: Optional[Floats] = None,
                     begin: int = 0, end: Optional[int] = None) -> Floats:
        """Positions [T, N, 3] in many states at once: weights [T, K], scales [T] or [T, G]."""
        weights = np.ascontiguousarray(weights, np.float64)
        count = weights.shape[0]
        scales = np.asarray(scales, np.float64).reshape(count, -1)
        scales = np.ascontiguousarray(np.broadcast_to(scales, (count, len(self.lungs))))
        end = self.vertex_count if end is None else end
        if out is None:
            out = np.empty((count, max(end - begin, 0), 3), np.float32)
        self._c.deform_batch(count, weights, scales, begin, end, out)
        return out

    def normals(self, xyz: Floats, out: Optional[Floats] = None) -> Floats:
        """Unit normals [N, 3] of a deformed surface, exactly, from its triangles."""
        if out is None:
            out = np.empty((self.vertex_count, 3), np.float32)
        self._c.normals(xyz, out)
        return out


def open(source: Union[str, bytes, bytearray, memoryview, os.PathLike[str]], *, storage: str = "auto",
         simd: str = "auto", normals: bool = True) -> Basis:
    """Opens a basis file, or one in memory (bytes), checked whole.

    storage  how coefficients are kept: "auto" is the smallest that errs by 0.005 mm at most; "exact"
    normals  False leaves the normals out of memory
    """
    return Basis(source, storage=storage, simd=simd, normals=normals)
