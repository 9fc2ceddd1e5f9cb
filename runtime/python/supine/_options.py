# SPDX-License-Identifier: MIT
"""Fill the struct of the offline library from the keyword arguments of `precompute`."""
from __future__ import annotations

import difflib
import os
from typing import Any, Callable, Sequence

import numpy as np

from . import _library as _c

_UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 0.001, "in": 25.4}


def _refuse(name: str, wants: str, value: Any) -> _c.ArgumentError:
    return _c.ArgumentError(f"{name} takes {wants}, not '{value}'")


def _number(name: str, value: Any, wants: str = "a number") -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise _refuse(name, wants, value)
    return number


def _count(name: str, value: Any, wants: str = "a whole number") -> int:
    number = _number(name, value, wants)
    if number != int(number) or number < 0:
        raise _refuse(name, wants, value)
    return int(number)


def _numbers(name: str, value: Any, count: int) -> Any:
    parts = value.split(",") if isinstance(value, str) else value
    if not isinstance(parts, Sequence) or len(parts) != count:
        raise _refuse(name, f"{count} numbers", value)
    return (_c.c_double * count)(*(_number(name, part) for part in parts))


def _choice(name: str, value: Any) -> int:
    """Return the index of a value among those that the C library names for an option."""
    names = _c.names_of(name)
    if value not in names:
        raise _refuse(name, " or ".join(names), value)
    return names.index(value)


def _path(value: Any) -> bytes:
    return os.fsencode(value)


def _pairs(name: str, value: Any, separator: str, wants: str) -> list[tuple[str, Any]]:
    """Split a dict, or a text such as a=b,c=d, into pairs."""
    if isinstance(value, dict):
        return list(value.items())
    pairs = [tuple(part.split(separator, 1)) for part in str(value).split(",")]
    if any(len(pair) != 2 for pair in pairs):
        raise _refuse(name, wants, value)
    return pairs  # type: ignore[return-value]


def _scanned(to: _c.PrecomputeOptions, value: Any) -> None:
    to.scan.shown = 1
    if value == "none":
        to.scan.shown = 2
        return
    to.scan.state.gravity = (_c.c_double * 3)(0.0, 1.0, 0.0)
    try:
        _c.state_parse(str(value).encode(), to.scan.state)
    except _c.ArgumentError as error:
        raise _c.ArgumentError(f"scanned: {error}") from None


def _resting(to: _c.PrecomputeOptions, value: Any) -> None:
    wants = "copd, POSTURE=2600mL or POSTURE=SHARE,..."
    if isinstance(value, str) and "copd" in value.split(","):
        to.volumes.copd = True
        value = ",".join(part for part in value.split(",") if part != "copd")
    postures = _c.names_of("resting")
    for posture, amount in _pairs("resting", value, "=", wants) if value else []:
        if posture not in postures:
            raise _c.ArgumentError(f"resting: '{posture}' is not one of {', '.join(postures)}")
        rest, text = to.volumes.rest[postures.index(posture)], str(amount)
        if text.lower().endswith("l"):
            state = _c.State()
            _c.state_parse_volume(text.encode(), state)
            rest.ml = state.volume.ml
        else:
            for k, share in enumerate(text.split("/")[:2]):
                rest.share[k] = _number("resting", share, wants)


def _full(to: _c.PrecomputeOptions, value: Any) -> None:
    state = _c.State()
    if isinstance(value, (int, float)):
        to.volumes.full = value
        return
    _c.state_parse(str(value).encode(), state)
    if state.volume.kind != 4:  # an absolute volume
        raise _refuse("full", "a volume such as 4200mL", value)
    to.volumes.full = state.volume.ml


def _expandability(to: _c.PrecomputeOptions, value: Any) -> None:
    tissue, parts = to.tissue, str(value).split(":")
    if value == "uniform":
        return
    if parts[0] not in ("linear", "exp"):
        tissue.expandability = _path(value)
        return
    if len(parts) != 4 or parts[1] not in ("x", "y", "z"):
        raise _refuse("expandability", "uniform, linear:AXIS:FROM:TO, exp:AXIS:FROM:TO or a file", value)
    tissue.profile, tissue.axis = 1 + (parts[0] == "exp"), "xyz".index(parts[1])
    tissue.start, tissue.end = (_number("expandability", part) for part in parts[2:])


def _lesion(to: _c.PrecomputeOptions, value: Any) -> None:
    tissue, numbers = to.tissue, _numbers("lesion", value, 5)
    if tissue.lesion_count == len(tissue.lesions):
        raise _c.ArgumentError(f"lesion: at most {len(tissue.lesions)} lesions")
    lesion = tissue.lesions[tissue.lesion_count]
    lesion.centre[:], lesion.radius, lesion.factor = numbers[:3], numbers[3], numbers[4]
    if not (lesion.radius > 0 and lesion.factor > 0):
        raise _refuse("lesion", "X,Y,Z,RADIUS,FACTOR, the last two above 0", value)
    tissue.lesion_count += 1


def _lung(to: _c.PrecomputeOptions, value: Any) -> None:
    wants = "left:SHARE or right:SHARE, above 0 and at most 1"
    for side, share in _pairs("lung", value, ":", wants):
        if side not in ("left", "right"):
            raise _refuse("lung", wants, value)
        if to.tissue.share[("left", "right").index(side)] > 0:
            raise _c.ArgumentError(f"lung: the {side} lung is given twice: give its share once")
        to.tissue.share[("left", "right").index(side)] = _number("lung", share, wants)


def _units(to: _c.PrecomputeOptions, value: Any) -> None:
    to.lungs.unit = _UNITS.get(value) or _number("units", value, "mm, cm, m, um, in, or a number of millimetres")


def _modes(to: _c.PrecomputeOptions, value: Any) -> None:
    wants = "1 to 64 or 'harmonics'"
    to.modes.harmonics = value == "harmonics"
    if not to.modes.harmonics:
        to.modes.count = _count("modes", value, wants)
        if not 1 <= to.modes.count <= 64:
            raise _refuse("modes", wants, value)


def _labels(to: _c.PrecomputeOptions, value: Any) -> None:
    text = ",".join(f"{side}={labels}" for side, labels in value.items()) if isinstance(value, dict) else str(value)
    to.lungs.labels = text.encode()


def _midline(to: _c.PrecomputeOptions, value: Any) -> None:
    to.lungs.has_midline, to.lungs.midline = True, _number("midline", value)


def _band(to: _c.PrecomputeOptions, value: Any) -> None:
    to.modes.has_band, to.modes.band = True, _count("band", value)


def _held_out(to: _c.PrecomputeOptions, value: Any) -> None:
    to.modes.held_out = _count("held_out", value)
    if to.modes.held_out == 0:
        raise _refuse("held_out", "1 to 100000", value)


def _law(part: str) -> Callable[[_c.PrecomputeOptions, Any], None]:
    """Make the function that sets a constant of the law."""
    def fill(to: _c.PrecomputeOptions, value: Any) -> None:
        size = {"box_force": 3, "constants": 6}.get(part)
        setattr(to.law, part, _numbers(part, value, size) if size else _number(part, value))
        if hasattr(to.law, "has_" + part):
            setattr(to.law, "has_" + part, True)
    return fill


def _set(concern: str, part: str, convert: Callable[[Any], Any]) -> Callable[[_c.PrecomputeOptions, Any], None]:
    """Make the function that sets a member of the struct."""
    def fill(to: Any, value: Any) -> None:
        setattr(getattr(to, concern) if concern else to, part, convert(value))
    return fill


_FILL: dict[str, Callable[[Any, Any], None]] = {
    "axes": _set("lungs", "axes", lambda value: str(value).upper().encode()),
    "units": _units, "midline": _midline, "labels": _labels,
    "edge": _set("lungs", "edge", lambda value: _number("edge", value)),
    "close": _set("lungs", "close", lambda value: _number("close", value)),
    "surfaces_out": _set("lungs", "surfaces_out", _path),
    "scanned": _scanned, "resting": _resting, "full": _full,
    "height": _set("volumes", "height", lambda value: _number("height", value)),
    "sex": _set("volumes", "sex", lambda value: _choice("sex", value)),
    "law": _set("law", "kind", lambda value: 1 + _choice("law", value)),
    **{part: _law(part) for part in ("base", "gain", "box_force", "soften", "constants", "shear", "reach")},
    "expandability": _expandability, "lesion": _lesion, "lung": _lung,
    "band": _band, "modes": _modes, "held_out": _held_out,
    "without_normals": _set("modes", "without_normals", bool),
    "storage": _set("modes", "storage", lambda value: _choice("storage", value)),
    "patient": _set("", "patient", _path), "fields": _set("", "fields", _path)}


def fill(to: _c.PrecomputeOptions, options: dict[str, Any]) -> None:
    """Fill the struct from keyword arguments; None and False leave the default, and a list repeats an option."""
    for name, given in options.items():
        for value in given if isinstance(given, list) else [given]:
            if isinstance(value, np.ndarray):
                raise TypeError(f"{name}: an option cannot be an array: give a tuple, or a file")
            if name not in _FILL:
                near = difflib.get_close_matches(name, _FILL, 1)
                hint = f"; did you mean '{near[0]}'?" if near else ""
                raise _c.ArgumentError(f"no option '{name}'{hint}")
            if value is not None and value is not False:
                _FILL[name](to, value)


def describe(result: _c.Result) -> str:
    """Say in text what a basis is, what was assumed, and its error."""
    report = result.report
    lungs = "two lungs" if report.lung_count == 2 else "one lung"
    assumed = "".join(f"  {_c.string(result.assumptions[i])}\n" for i in range(result.assumption_count))
    against = ("error of the basis, each direction predicted from the others" if report.band_count
               else f"error against the full solve, on {report.direction_count} held-out directions")
    errors = "".join(f"  {100 ** percent * rms:.3g} {unit} RMS, {100 ** percent * p95:.3g} {unit} 95th percentile, "
                     f"{100 ** percent * largest:.3g} {unit} largest\n"
                     for (rms, p95, largest), unit, percent in ((report.relative, "%", 1), (report.mm, "mm", 0)))
    if report.turning_rms > 0:
        errors += f"  {100 * report.turning_rms:.3g} % RMS, of the part of the displacement that depends on gravity\n"
    return (f"{lungs}, {report.vertex_count} vertices, band {report.band}, {report.mode_count} modes\n"
            f"assumed and given:\n{assumed}{against}:\n{errors}")
