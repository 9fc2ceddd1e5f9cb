# SPDX-License-Identifier: MIT
"""Declare the types and functions of the C library, and its statuses as exceptions."""
from __future__ import annotations

import ctypes
import ctypes.util
import os
from ctypes import (POINTER, c_bool, c_char, c_char_p, c_double, c_float, c_int, c_int16, c_size_t, c_uint32, c_uint64,
                    c_void_p)
from typing import Any, Optional


MODES_MAX, LUNGS_MAX, FACTS_MAX = 256, 16, 32


def _path(name: str) -> Optional[str]:
    """Find a library in this folder, where wheels have it, or else in the system."""
    beside = os.path.join(os.path.dirname(__file__), f"lib{name}.so")
    return beside if os.path.exists(beside) else ctypes.util.find_library(name)


def _load() -> ctypes.CDLL:
    """Load the run-time library."""
    path = _path("supine_runtime")
    if path is None:
        raise ImportError("the library supine_runtime is neither beside the package nor in the system: install the "
                          "wheel, or "
                          "the library, or copy libsupine_runtime.so into " + os.path.dirname(__file__))
    return ctypes.CDLL(path)


_c = _load()


class Error(Exception):
    """A failure that the C library or the program reports, with its message."""


class ArgumentError(Error, ValueError):
    pass


class OutOfMemoryError(Error, MemoryError):
    pass


class ReadError(Error, OSError):
    pass


class FormatError(Error, ValueError):
    pass


class MeshError(Error, ValueError):
    pass


class OpenSurfaceError(Error, ValueError):
    pass


class UnsupportedError(Error, NotImplementedError):
    pass


class NumericalError(Error, ArithmeticError):
    pass


# Exceptions in the order of supine_status.
_ERRORS = (Error, ArgumentError, OutOfMemoryError, ReadError, FormatError, MeshError, OpenSurfaceError,
           UnsupportedError, Error, NumericalError, Error)
for _kind in _ERRORS:
    _kind.__module__ = "supine"  # the package that users import


class Remedy(ctypes.Structure):
    """The C struct supine_remedy."""
    _fields_ = [("kind", c_int), ("argument", c_char_p), ("value", c_char * 32), ("when", c_char_p)]


class CError(ctypes.Structure):
    """The C struct supine_error."""
    _fields_ = [("status", c_int), ("message", c_char * 512), ("remedies", Remedy * 3)]


class Volume(ctypes.Structure):
    """The C struct supine_volume."""
    _fields_ = [("kind", c_int), ("ml", c_double)]


class LungVolume(ctypes.Structure):
    _fields_ = [("name", c_char * 16), ("volume", Volume)]


class State(ctypes.Structure):
    """The C struct supine_state."""
    _fields_ = [("gravity", c_double * 3), ("volume", Volume), ("lung_count", c_size_t), ("lungs", LungVolume * 2)]


class CPose(ctypes.Structure):
    """The C struct supine_pose."""
    _fields_ = [("weights", c_double * MODES_MAX), ("gains", c_double * 3 * LUNGS_MAX), ("basis", c_uint64),
                ("expansion", c_double * LUNGS_MAX)]


class GivenPose:
    """The type of arguments that are a pose. It refuses None, which POINTER(CPose) would accept."""
    @staticmethod
    def from_param(pose: Any) -> Any:
        if not isinstance(pose, CPose):
            raise TypeError("the argument must be a pose: make one with Basis.pose")
        return ctypes.byref(pose)


class Options(ctypes.Structure):
    """The C struct supine_basis_options."""
    _fields_ = [("size", c_size_t), ("storage", c_int), ("simd", c_int), ("without_normals", c_bool),
                ("allow_folds", c_bool)]


class Info(ctypes.Structure):
    """The C struct supine_basis_info."""
    _fields_ = [("vertex_count", c_size_t), ("triangle_count", c_size_t), ("mode_count", c_size_t),
                ("band", c_size_t), ("lung_count", c_size_t), ("lung_begin", POINTER(c_size_t)),
                ("vector", c_bool), ("has_volume", c_bool), ("storage", c_int), ("simd", c_int),
                ("bytes_per_vertex", c_double), ("storage_error", c_double), ("lung_names", POINTER(c_char_p)),
                ("bounds", POINTER(c_float)), ("vertices", c_void_p), ("triangles", c_void_p),
                ("direction", c_void_p), ("coefficients", c_void_p), ("modes", c_void_p),
                ("volume_linear", c_void_p), ("volume_quadratic", c_void_p), ("volume_cubic", c_void_p),
                ("packed", c_void_p), ("normal_count", c_size_t), ("normals", c_void_p),
                ("normal_weights", c_void_p), ("reference_volume", c_void_p), ("has_rest", c_bool),
                ("has_full", c_bool), ("is_fields", c_bool), ("bend", c_double * 3),
                ("identity", c_uint64), ("order", c_size_t), ("cluster_count", c_size_t), ("cluster", c_void_p),
                ("cluster_scalars", c_void_p), ("cluster_vectors", c_void_p), ("hilum", POINTER(c_double))]


class Tensor(ctypes.Structure):
    """The C struct supine_tensor."""
    _fields_ = [("name", c_char_p), ("dtype", c_int), ("rank", c_size_t), ("shape", c_size_t * 4), ("data", c_void_p)]


# Element types in the order of supine_dtype.
DTYPES = (ctypes.c_uint8, c_uint32, c_float, c_double, c_int16, ctypes.c_int8, ctypes.c_uint16)


class Metadata(ctypes.Structure):
    """The C struct supine_metadata."""
    _fields_ = [("key", c_char_p), ("value", c_char_p)]


class Fact(ctypes.Structure):
    """The C struct supine_fact."""
    _fields_ = [("value", c_double), ("low", c_double), ("high", c_double), ("name", c_char_p), ("unit", c_char_p),
                ("origin", c_char_p), ("source", c_int), ("text", c_char * 164)]


class Breath(ctypes.Structure):
    """The C struct supine_pv_breath."""
    _fields_ = [("tidal", c_double), ("rate", c_double), ("inhale_fraction", c_double),
                ("rest_pressure", c_double), ("course", c_int)]


class Observation(ctypes.Structure):
    """The C struct supine_observation."""
    _fields_ = [("vertex", c_size_t), ("position", c_double * 3), ("noise", c_double), ("on_line", c_bool),
                ("from_", c_double * 3)]


class LocateTask(ctypes.Structure):
    """The C struct supine_locate_task."""
    _fields_ = [("inside", c_void_p), ("count", c_size_t), ("observed", POINTER(Observation)), ("state", State),
                ("rigid", c_bool), ("depth", c_double)]


class LocationInfo(ctypes.Structure):
    """The C struct supine_location_info."""
    _fields_ = [("state", State), ("volume", c_double), ("volume_error", c_double), ("volume_prior_error", c_double),
                ("rotation", c_double * 9), ("translation", c_double * 3), ("residual_rms", c_double),
                ("log_evidence", c_double), ("outlier_count", c_size_t), ("residual_expected", c_double),
                ("turn", c_double), ("depth_error", c_double), ("stretch", c_double * 3),
                ("stretch_error", c_double * 3)]


class DoubtTask(ctypes.Structure):
    """The C struct supine_doubt_task."""
    _fields_ = [("basis", c_void_p), ("state_count", c_size_t), ("states", POINTER(State)), ("since", POINTER(State)),
                ("another_day", c_bool), ("location", c_void_p)]


class DoubtPoint(ctypes.Structure):
    """The C struct supine_doubt_point."""
    _fields_ = [("vertex", c_size_t), ("state", c_size_t)]


class Surface(ctypes.Structure):
    """The C struct supine_precompute_surface."""
    _fields_ = [("vertex_count", c_size_t), ("vertices", c_void_p), ("triangle_count", c_size_t),
                ("triangles", c_void_p)]


ProgressFunction = ctypes.CFUNCTYPE(c_int, c_void_p, c_double)


class Lungs(ctypes.Structure):
    """The C struct supine_precompute_lungs."""
    _fields_ = [("paths", POINTER(c_char_p)), ("path_count", c_size_t), ("surfaces", POINTER(Surface)),
                ("surface_count", c_size_t), ("axes", c_char_p), ("unit", c_double), ("has_midline", c_bool),
                ("midline", c_double), ("labels", c_char_p), ("edge", c_double), ("close", c_double),
                ("surfaces_out", c_char_p)]


class Scan(ctypes.Structure):
    """The C struct supine_precompute_scan."""
    _fields_ = [("shown", c_int), ("state", State)]


class Law(ctypes.Structure):
    """The C struct supine_precompute_law."""
    _fields_ = [("kind", c_int), ("has_base", c_bool), ("has_gain", c_bool), ("has_box_force", c_bool),
                ("has_constants", c_bool), ("has_shear", c_bool), ("base", c_double), ("gain", c_double),
                ("box_force", c_double * 3), ("soften", c_double), ("constants", c_double * 6), ("shear", c_double),
                ("reach", c_double)]


class Lesion(ctypes.Structure):
    """The C struct supine_precompute_lesion."""
    _fields_ = [("centre", c_double * 3), ("radius", c_double), ("factor", c_double)]


class Tissue(ctypes.Structure):
    """The C struct supine_precompute_tissue; `start` and `end` are its members from and to."""
    _fields_ = [("profile", c_int), ("axis", c_int), ("start", c_double), ("end", c_double),
                ("expandability", c_char_p), ("lesion_count", c_size_t), ("lesions", Lesion * 64),
                ("share", c_double * 2)]


class Rest(ctypes.Structure):
    """The C struct supine_precompute_rest."""
    _fields_ = [("ml", c_double), ("share", c_double * 2)]


class Volumes(ctypes.Structure):
    """The C struct supine_precompute_volumes."""
    _fields_ = [("full", c_double), ("rest", Rest * 6), ("copd", c_bool), ("height", c_double), ("sex", c_int)]


class Modes(ctypes.Structure):
    """The C struct supine_precompute_modes."""
    _fields_ = [("has_band", c_bool), ("band", c_size_t), ("count", c_size_t), ("harmonics", c_bool),
                ("held_out", c_size_t), ("without_normals", c_bool), ("storage", c_int)]


class PrecomputeOptions(ctypes.Structure):
    """The C struct supine_precompute_options."""
    _fields_ = [("size", c_size_t), ("lungs", Lungs), ("scan", Scan), ("law", Law), ("tissue", Tissue),
                ("volumes", Volumes), ("modes", Modes), ("patient", c_char_p), ("fields", c_char_p),
                ("made_by", c_char_p), ("progress", ProgressFunction), ("context", c_void_p)]


class Report(ctypes.Structure):
    """The C struct supine_precompute_report; errors are RMS, 95th percentile and largest."""
    _fields_ = [("lung_count", c_size_t), ("vertex_count", c_size_t), ("band", c_size_t), ("mode_count", c_size_t),
                ("direction_count", c_size_t), ("relative", c_double * 3), ("mm", c_double * 3), ("rest_known", c_bool),
                ("rest_part", c_double), ("volume", c_double), ("turned_over", c_double), ("band_count", c_size_t),
                ("band_error", c_double * 12), ("volume_count", c_size_t), ("order", c_size_t),
                ("extrapolated", c_double), ("cluster_count", c_size_t), ("volume_error", c_double),
                ("six_volumes", c_double), ("displacement", c_double), ("nearest_supine", c_double * 3),
                ("along_gravity", c_double), ("turning_rms", c_double)]


class Finding(ctypes.Structure):
    """The C struct supine_finding."""
    _fields_ = [("is_warning", c_bool), ("text", c_char * 640), ("remedies", Remedy * 3)]


class Findings(ctypes.Structure):
    """The C struct supine_findings."""
    _fields_ = [("count", c_size_t), ("dropped", c_size_t), ("list", Finding * 32)]


class Result(ctypes.Structure):
    """The C struct supine_precompute_result."""
    _fields_ = [("bytes", c_void_p), ("size", c_size_t), ("report", Report), ("assumptions", POINTER(c_char_p)),
                ("assumption_count", c_size_t), ("findings", POINTER(Findings))]


class Residual(ctypes.Structure):
    """The C struct supine_locate_residual."""
    _fields_ = [("distance", c_double), ("sigma", c_double), ("outlier", c_bool)]


def _declare(name: str, result: Any, *arguments: Any) -> Any:
    function = getattr(_c, "supine_" + name)
    function.restype, function.argtypes = result, arguments
    return function


def _checked(name: str, *arguments: Any) -> Any:
    """Declare a function whose last argument is a supine_error; it raises an exception on failure."""
    function = _declare(name, c_int, *arguments, POINTER(CError))

    def call(*given: Any) -> None:
        error = CError()
        status = function(*given, error)
        if status != 0:
            fail(status, error.message, error)
    return call


_POSED = {1: b"the pose was made by another basis, or has a number that is not finite: make it by Basis.pose of this "
          b"basis",
          6: b"the surface is open and encloses no volume",
          7: b"the basis was made or opened without normals: normals() computes them from the triangles"}


def _posed(name: str, *arguments: Any) -> Any:
    """Declare a function that evaluates a pose; it raises an exception on failure."""
    function = _declare(name, c_int, *arguments)

    def call(*given: Any) -> None:
        status = function(*given)
        if status != 0:
            fail(status, _POSED.get(status, b""))
    return call


def fail(status: int, message: bytes = b"", error: Optional[CError] = None) -> None:
    """Raise the exception for a status. If the message is that of an error, add what to do about it."""
    text = (message or status_string(status)).decode(errors="replace")
    if error is not None and message:
        text = explain(message, error.remedies)
    raise _ERRORS[status if 0 < status < len(_ERRORS) else 0](text)


version = _declare("version", c_char_p)
status_string = _declare("status_string", c_char_p, c_int)
remedies_add = _declare("remedies_add", None, POINTER(Remedy), c_int, c_char_p, c_size_t)
posture_count = _declare("posture_count", c_size_t)
posture_name = _declare("posture_name", c_char_p, c_size_t)
posture_rotation = _checked("posture_rotation", c_void_p, c_size_t, c_double * 3, c_char_p, c_double * 3)
posture_roll = _declare("posture_roll", c_int, c_double * 3, c_double, c_double * 3)
posture_tilt = _declare("posture_tilt", c_int, c_double * 3, c_double, c_double * 3)
state_parse = _checked("state_parse", c_char_p, POINTER(State))
state_parse_volume = _checked("state_parse_volume", c_char_p, POINTER(State))
state_join = _checked("state_join", POINTER(State), POINTER(State), POINTER(State))
state_parse_posture = _checked("state_parse_posture", c_char_p, POINTER(State))
breath_normal = _declare("breath_normal", c_void_p)
breath_evaluate = _checked("breath_evaluate", c_void_p, POINTER(Breath), c_size_t, c_void_p, c_void_p, c_void_p)
basis_open = _checked("basis_open_with", c_char_p, POINTER(Options), POINTER(c_void_p))
basis_open_memory = _checked("basis_open_memory_with", c_void_p, c_size_t, POINTER(Options), POINTER(c_void_p))
basis_close = _declare("basis_close", None, c_void_p)
basis_get_info = _declare("basis_get_info", POINTER(Info), c_void_p)
basis_all_metadata = _declare("basis_all_metadata", POINTER(Metadata), c_void_p, POINTER(c_size_t))
basis_tensor = _declare("basis_tensor", POINTER(Tensor), c_void_p, c_char_p)
basis_tell = _declare("basis_tell", None, c_void_p, POINTER(State), GivenPose, POINTER(Findings))
basis_pose = _checked("basis_pose", c_void_p, POINTER(State), GivenPose)
basis_pose_gain = _checked("basis_pose_gain", c_void_p, c_double * 3, c_double, GivenPose)
basis_scan_pose = _checked("basis_scan_pose", c_void_p, GivenPose)
basis_volumes = _posed("basis_volumes", c_void_p, GivenPose, c_void_p)
basis_coefficients = _posed("basis_coefficients", c_void_p, c_size_t, c_size_t, c_void_p)
basis_facts = _declare("basis_facts", c_size_t, c_void_p, POINTER(Fact))
basis_caveats = _declare("basis_caveats", c_size_t, c_void_p, c_char_p, c_size_t)
fact_print = _declare("fact_print", c_size_t, POINTER(Fact), c_char_p, c_size_t)
fact_is_caveat = _declare("fact_is_caveat", c_bool, POINTER(Fact))
fact_source_name = _declare("fact_source_name", c_char_p, c_int)
basis_error = _declare("basis_error", c_double, c_void_p, GivenPose)
deform_range = _posed("deform_range", c_void_p, GivenPose, c_size_t, c_size_t, c_void_p)
displace_range = _posed("displace_range", c_void_p, GivenPose, c_size_t, c_size_t, c_void_p)
deform_lit_range = _posed("deform_lit_range", c_void_p, GivenPose, c_size_t, c_size_t, c_void_p, c_void_p)
deform_batch = _posed("deform_batch", c_void_p, c_size_t, POINTER(CPose), c_size_t, c_size_t, c_void_p)
expected_error = _checked("expected_error", c_void_p, POINTER(State), POINTER(State), c_void_p)
doubt_space = _declare("doubt_space", c_size_t, c_void_p, c_size_t)
doubt_prepare = _checked("doubt_prepare", POINTER(DoubtTask), c_void_p, POINTER(c_void_p))
doubt_covariance = _checked("doubt_covariance", c_void_p, c_size_t, POINTER(DoubtPoint), c_void_p, c_void_p)
doubt_sample = _checked("doubt_sample", c_void_p, c_size_t, c_uint64, c_size_t, c_void_p)
doubt_mend_space = _declare("doubt_mend_space", c_size_t, c_void_p)
doubt_mend_prepare = _checked("doubt_mend_prepare", c_void_p, c_size_t, c_void_p, POINTER(c_void_p))
doubt_mend_sample = _checked("doubt_mend_sample", c_void_p, c_void_p)
doubt_frame_space = _declare("doubt_frame_space", c_size_t, c_void_p, c_size_t)
doubt_frame_prepare = _checked("doubt_frame_prepare", c_void_p, c_size_t, POINTER(c_size_t), c_void_p,
                               POINTER(c_void_p))
doubt_frame_motion = _declare("doubt_frame_motion", None, c_void_p, c_void_p, c_void_p)
doubt_frame_errors = _posed("doubt_frame_errors", c_void_p, c_size_t, c_size_t, c_void_p)
expected_another_day = _declare("expected_another_day", c_double, c_double)
locate_space = _declare("locate_space", c_size_t, c_size_t)
locate = _checked("locate", POINTER(LocateTask), POINTER(Residual), c_void_p, POINTER(c_void_p))
location_info = _declare("location_get_info", POINTER(LocationInfo), c_void_p)
location_check = _declare("location_check", None, POINTER(LocationInfo), POINTER(Findings))
locate_positions = _checked("locate_positions", c_void_p, c_void_p, c_void_p, c_void_p)
normals = _declare("normals", None, c_void_p, c_void_p, c_void_p)


def string(text: Optional[bytes]) -> str:
    """Decode UTF-8; return "" for None."""
    return (text or b"").decode(errors="replace")


def names_of(option: str) -> list[str]:
    """Return the names of the values of an option of the offline library."""
    library, found = offline(), []
    names = library.supine_precompute_names(option.encode()) if library else [None]
    while names[len(found)] is not None:
        found.append(string(names[len(found)]))
    return found


def explain(message: bytes, remedies: Any) -> str:
    """Return the message of an error or a finding, and what to do in the words of the package."""
    text = ctypes.create_string_buffer(message, 1024)
    remedies_add(remedies, 1, text, len(text))
    return string(text.value)


def offline() -> Optional[ctypes.CDLL]:
    """Load the offline library (GPL), or return None if it is not installed."""
    path = _path("supine_precompute")
    if path is None:
        return None
    library = ctypes.CDLL(path)
    library.supine_precompute_basis.argtypes = POINTER(PrecomputeOptions), POINTER(POINTER(Result)), POINTER(CError)
    library.supine_precompute_result_free.argtypes = POINTER(Result),
    library.supine_precompute_result_free.restype = None
    library.supine_precompute_names.argtypes = c_char_p,
    library.supine_precompute_names.restype = POINTER(c_char_p)
    return library
