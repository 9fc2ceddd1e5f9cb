# SPDX-License-Identifier: MIT
"""Make bases and move images, by the offline library where it is installed, or by the program `supine`."""
from __future__ import annotations

import csv
import ctypes
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from typing import Any, Callable, Iterable, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _library as _c
from . import _options

Progress = Callable[[float], Any]
_EXITS: dict[int, type[_c.Error]] = {1: _c.ArgumentError, 2: _c.FormatError, 3: _c.UnsupportedError,
                                     5: _c.NumericalError}


def find() -> str:
    """Find the program beside this file, or on PATH."""
    found = shutil.which("supine", path=os.path.dirname(__file__)) or shutil.which("supine")
    if found is None:
        raise _c.UnsupportedError("the program 'supine' is neither on PATH nor beside the package: install it, as "
                                  "precompute, embed, warp and augment run it")
    return found


def words(options: dict[str, Any]) -> list[str]:
    """Convert options to arguments of the program. held_out=200 becomes --held-out 200. The value True becomes a flag,
    a tuple becomes a,b,c and a dict becomes a=b,c=d; a list repeats the option."""
    words: list[str] = []
    for name, given in options.items():
        for value in given if isinstance(given, list) else [given]:
            if isinstance(value, np.ndarray):
                raise TypeError(f"{name}: an option cannot be an array: give a tuple, or a file")
            if isinstance(value, dict):
                value = tuple(f"{key}={part}" for key, part in value.items())
            if isinstance(value, tuple):
                value = ",".join(map(str, value))
            if value is not None and value is not False:
                words.append("--" + name.replace("_", "-"))
                words += [] if value is True else [os.fspath(value) if isinstance(value, os.PathLike) else str(value)]
    return words


def _mesh(vertices: ArrayLike, faces: ArrayLike) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Check a surface: vertices [N, 3]; faces [M, 3], or an array 3, a, b, c, 3, ... like `Basis.faces`."""
    points, corners = np.asarray(vertices, "<f8"), np.asarray(faces)
    if corners.ndim == 1 and corners.size % 4 == 0 and (corners[::4] == 3).all():
        corners = corners.reshape(-1, 4)[:, 1:]
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"vertices must be [N, 3], not {list(points.shape)}")
    if corners.ndim != 2 or corners.shape[1] != 3 or corners.dtype.kind not in "iu":
        raise ValueError(f"faces must be integers [M, 3], not {corners.dtype} {list(corners.shape)}")
    return points, np.clip(corners, -1, 2**31 - 1)  # out-of-range indices stay so: they are reported


def _write_mesh(path: str, points: np.ndarray[Any, Any], corners: np.ndarray[Any, Any]) -> None:
    records = np.empty(len(corners), [("count", "u1"), ("corner", "<i4", 3)])
    records["count"] = 3
    records["corner"] = corners
    with open(path, "wb") as file:
        file.write(b"ply\nformat binary_little_endian 1.0\n"
                   b"element vertex %d\nproperty double x\nproperty double y\nproperty double z\n"
                   b"element face %d\nproperty list uchar int vertex_indices\nend_header\n" %
                   (len(points), len(corners)))
        file.write(points.tobytes() + records.tobytes())


def table(rows: Iterable[Sequence[Any]]) -> bytes:
    """Return rows as the content of a CSV file."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def _write_points(path: str, points: Union[ArrayLike, Mapping[str, Sequence[float]]]) -> None:
    """Write points [n, 3], or a dict from names to points, as CSV."""
    for name, place in points.items() if isinstance(points, Mapping) else ():
        if np.shape(place) != (3,):
            raise ValueError(f"point {name!r} must be three numbers x, y, z, not {list(np.shape(place))}: give each "
                             f"point a "
                             "name of its own")
    names = [[name] for name in points] if isinstance(points, Mapping) else None
    places = np.asarray(list(points.values()) if isinstance(points, Mapping) else points, np.float64)
    if places.ndim not in (1, 2) or places.size == 0 or places.shape[-1] != 3:
        raise ValueError(f"points must be [n, 3], not {list(places.shape)}")
    rows = places.reshape(-1, 3).tolist()
    with open(path, "wb") as file:
        file.write(table([["x", "y", "z", "name"], *(row + name for row, name in zip(rows, names))] if names
                         else [["x", "y", "z"], *rows]))


def save_fields(path: Union[str, "os.PathLike[str]"], points: ArrayLike, gravity: ArrayLike,
                displacement: ArrayLike, run: Optional[ArrayLike] = None) -> None:
    """Write another simulator's displacement fields as a safetensors file for `supine precompute --fields`.

    points: [P, 3], positions of the points before they move, such as the nodes of a volume mesh; each vertex of the
        surface must be among them
    gravity: [M, 3], direction of gravity of each simulation; or [R, 4], with the number of its run
    displacement: [M, P, 3], displacement of each point in each simulation
    run: [M], number of the run of each row of displacement, which may then have any order: a row belongs to the row of
        gravity with this run or, if gravity is [R, 3], to the row of this number
    All in the axes and unit of the file of the surface. Numbers are stored as float32."""
    arrays = {"points": np.asarray(points, "<f4"), "gravity": np.asarray(gravity, "<f4"),
              "displacement": np.asarray(displacement, "<f4")}
    shapes = [array.shape for array in arrays.values()]
    rows = shapes[2][:1] if run is None else shapes[1][:1]
    if (shapes[1] not in (rows + (3,), rows + (4,)) or shapes[2] != shapes[2][:1] + shapes[0]
            or shapes[0][1:] != (3,)):
        raise ValueError(f"expected points [P, 3], gravity [M, 3] and displacement [M, P, 3], not {shapes}")
    if run is not None:
        arrays["run"] = np.asarray(run, "<f4")
        if arrays["run"].shape != shapes[2][:1]:
            raise ValueError(f"expected the run of each row of displacement, {list(shapes[2][:1])}, not "
                             f"{list(arrays['run'].shape)}")
    header, end = {}, 0
    for name, array in arrays.items():
        header[name] = {"dtype": "F32", "shape": array.shape, "data_offsets": [end, end + array.nbytes]}
        end += array.nbytes
    text = json.dumps(header).encode()
    with open(path, "wb") as file:
        file.write(len(text).to_bytes(8, "little") + text + b"".join(array.tobytes() for array in arrays.values()))


def _listen(terminal: int, command: str, progress: Optional[Progress]) -> str:
    """Read the terminal until the program ends: call `progress` with each fraction done; return all other lines."""
    said, line = "", b""
    if progress is not None:
        progress(0.0)
    while True:
        try:
            byte = os.read(terminal, 4096)
        except OSError:  # the program closed its end of the terminal
            byte = b""
        *lines, line = re.split(b"[\r\n]+", line + byte.replace(b"\x1b[K", b""))
        for text in (each.decode(errors="replace") for each in lines + ([] if byte else [line])):
            done = re.match(rf"{command}: +(\d+) %", text)
            if done is None:
                said += text + "\n" if text else ""
            elif progress is not None:
                progress(int(done[1]) / 100)
        if not byte:
            return said


def _own_names(text: str) -> str:
    """Replace options of the command, such as --held-out, by the arguments that become them, such as held_out. Commands
    to type, in quotes, stay."""
    parts = re.split(r"('supine [^']*')", text)
    parts[::2] = (re.sub(r"(?<![\w-])--([a-z][a-z-]*)", lambda option: option[1].replace("-", "_"), part)
                  for part in parts[::2])
    return "".join(parts)


def fail(command: str, status: int, said: str) -> None:
    """Raise an exception with the error message of a command."""
    messages = re.sub(rf"^supine {command}: ", "", said, flags=re.M).splitlines()
    what = ([""] + [m for m in messages if not re.match(r"(warning|note): |Try '", m)])[-1]
    kind = _EXITS.get(status, _c.Error)
    if status == 2 and "cannot read" in what:
        kind = _c.ReadError
    elif status == 2 and command == "precompute":
        kind = _c.MeshError
    raise kind(_own_names(what) or f"supine {command} ended with exit status {status}")


def told(findings: _c.Findings) -> list[str]:
    """Return the warnings among the findings of the C libraries, each with what to do."""
    return [_c.explain(each.text, each.remedies) for each in findings.list[:findings.count] if each.is_warning]


def warn(messages: Sequence[str]) -> None:
    """Raise each message as a Python warning at the line that called the package."""
    level = 1
    while sys._getframe(level).f_globals.get("__package__") == __package__:  # pylint: disable=protected-access
        level += 1
    for message in messages:
        warnings.warn(message, stacklevel=level + 1)


def warnings_of(command: str, said: str) -> list[str]:
    """Return the warnings in what a command wrote to standard error."""
    return [_own_names(text) for text in re.findall(rf"^supine {command}: warning: (.*)$", said, re.M)]


def run(command: str, operands: Sequence[str], options: dict[str, Any], names: dict[str, str],
        progress: Optional[Progress]) -> str:
    """Run a command and return its standard output. Its warnings become Python warnings. Its errors become exceptions
    with the same message.

    names: dict from the path of each temporary file to the name that messages show instead"""
    import pty  # not at the top, as Windows does not have this module

    arguments = [find(), command, *words(options), "--", *operands]
    terminal, other_end = pty.openpty()
    with tempfile.TemporaryFile() as report, subprocess.Popen(
            arguments, stdin=subprocess.DEVNULL, stdout=report, stderr=other_end) as process:
        os.close(other_end)
        try:
            said = _listen(terminal, command, progress)
        except BaseException:  # including Ctrl+C and exceptions of `progress`
            process.terminate()
            raise
        finally:
            os.close(terminal)
        status = process.wait()
        report.seek(0)
        text = report.read().decode(errors="replace")
    for path, name in names.items():
        said, text = said.replace(path, name), text.replace(path, name)
    warn(warnings_of(command, said))
    if status != 0:
        fail(command, status, said)
    if progress is not None:
        progress(1.0)
    return text


def make(command: str, lungs: Any, content: Sequence[Any], options: dict[str, Any],
         progress: Optional[Progress]) -> tuple[Any, str]:
    """Run a command that makes a basis; return the basis, as bytes or as the path `output`, and the standard output.

    lungs: basis that the command reads first (path or bytes), or None
    content: further inputs: paths, tuples (vertices, faces) or points; arrays are written to a temporary folder"""
    with tempfile.TemporaryDirectory(prefix="supine-") as folder:
        operands: list[str] = []
        names: dict[str, str] = {}

        def new_file(name: str, ending: str) -> str:
            operands.append(os.path.join(folder, name + ending))
            names[operands[-1]] = name
            return operands[-1]

        if lungs is not None and not isinstance(lungs, (str, os.PathLike)):
            with open(new_file("lungs", ".safetensors"), "wb") as copy:
                copy.write(lungs)
        elif lungs is not None:
            operands.append(os.fspath(lungs))
        for number, item in enumerate(content, 1):
            if isinstance(item, (str, os.PathLike)):
                operands.append(os.fspath(item))
            elif isinstance(item, tuple) and len(item) == 2:
                mesh = _mesh(*item)
                _write_mesh(new_file(f"surface {number}", ".ply"), *mesh)
            else:
                _write_points(new_file(f"points {number}", ".csv"), item)
        if isinstance(options.get("fields"), tuple):
            fields = os.path.join(folder, "fields")
            save_fields(fields, *options["fields"])
            options["fields"], names[fields] = fields, "fields"
        kept = options.pop("output", None)
        made = os.path.join(folder, "basis.safetensors") if kept is None else os.fspath(kept)
        names[made] = "basis" if kept is None else made
        report = run(command, operands, {**options, "output": made}, names, progress)
        if kept is not None:
            return made, report
        with open(made, "rb") as file:
            return file.read(), report


def _replace(path: str, content: bytes) -> None:
    """Write a file whole or not at all."""
    new = f"{path}.{os.getpid()}.new"
    try:
        with open(new, "xb") as file:
            file.write(content)
        os.replace(new, path)
    except BaseException:
        if os.path.exists(new):
            os.remove(new)
        raise


def precompute(surfaces: Sequence[Any], options: dict[str, Any], progress: Optional[Progress]) -> tuple[Any, str]:
    """Make a basis; return it, as bytes or as the path `output`, and the text of the program.

    Use the offline library if it is installed and the surfaces are all files or all arrays; else run the program."""
    meshes = [item for item in surfaces if not isinstance(item, (str, os.PathLike))]
    library = _c.offline()
    if library is None or 0 < len(meshes) < len(surfaces):
        return make("precompute", None, surfaces, options, progress)
    stopped: list[BaseException] = []

    def tell(_: Any, fraction: float) -> int:
        try:
            if progress is not None:
                progress(fraction)
        except BaseException as exception:  # pylint: disable=broad-exception-caught  # raised again below
            stopped.append(exception)
        return len(stopped)

    made_by = f"supine {_c.string(_c.version())} precompute " + " ".join(
        os.path.basename(word) for word in words({**options, "fields": "fields" if "fields" in options else None}))
    kept = options.pop("output", None)
    to = _c.PrecomputeOptions(ctypes.sizeof(_c.PrecomputeOptions))
    error, result = _c.CError(), ctypes.POINTER(_c.Result)()
    with tempfile.TemporaryDirectory(prefix="supine-") as folder:
        fields = os.path.join(folder, "fields")
        if isinstance(options.get("fields"), tuple):
            save_fields(fields, *options["fields"])
            options["fields"] = fields
        _options.fill(to, options)
        arrays = [(np.ascontiguousarray(points), np.ascontiguousarray(corners, "<u4"))
                  for points, corners in (_mesh(*item) for item in meshes)]
        to.lungs.surface_count = len(arrays)
        to.lungs.surfaces = (_c.Surface *
                             len(arrays))(*((len(points), points.ctypes.data, len(corners), corners.ctypes.data)
                                                         for points, corners in arrays))
        if not meshes:
            to.lungs.path_count = len(surfaces)
            to.lungs.paths = (ctypes.c_char_p * len(surfaces))(*(os.fsencode(path) for path in surfaces))
        to.made_by, to.progress = made_by.encode(errors="replace"), _c.ProgressFunction(tell)
        status = library.supine_precompute_basis(to, result, error)
    warned = told(result[0].findings[0]) if result else []
    made = ctypes.string_at(result[0].bytes, result[0].size) if status == 0 else b""
    report = _options.describe(result[0]) if status == 0 else ""
    library.supine_precompute_result_free(result)
    if stopped:
        raise stopped[0]
    warn(warned)
    if status != 0:  # the same kinds of exceptions as from the program, which calls any wrong input a mesh
        _c.fail(5 if status in (4, 6) else status, error.message.replace(fields.encode(), b"fields"), error)
    if kept is None:
        return made, report
    _replace(os.fspath(kept), made)
    return os.fspath(kept), report
