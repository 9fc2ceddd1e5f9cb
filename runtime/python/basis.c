/* SPDX-License-Identifier: MIT */
/* An open basis: a call here is one of the C library, with the interpreter's lock released where it
 * takes a pass over the vertices. */
#include <string.h>

#include <supine/runtime.h>

#include "runtime/python/python.h"

typedef struct handle {
  PyObject_HEAD supine_basis *basis;
  const supine_basis_info *info;
  Py_buffer bytes; /* what it was opened from; obj NULL: a file */
} handle;

static PyObject *handle_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"source", "storage", "simd", "normals", NULL};
  PyObject *source = NULL;
  PyObject *path = NULL;
  int storage = 0;
  int simd = 0;
  int normals = 1;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "O|iip", names, &source, &storage, &simd,
                                   &normals)) {
    return NULL;
  }
  handle *self = (handle *)PyType_GenericAlloc(type, 0);
  if (self == NULL) {
    return NULL;
  }
  const bool in_memory = PyObject_CheckBuffer(source) && !PyBytes_Check(source);
  if (in_memory || PyBytes_Check(source)) {
    if (PyObject_GetBuffer(source, &self->bytes, PyBUF_SIMPLE) != 0) {
      self->bytes.obj = NULL;
      goto fail;
    }
  } else if (!PyUnicode_FSConverter(source, &path)) {
    goto fail;
  }
  const supine_basis_options options = {.size = sizeof options,
                                        .storage = (supine_storage)storage,
                                        .simd = (supine_simd)simd,
                                        .without_normals = normals == 0};
  supine_error error = {SUPINE_OK, ""};
  supine_status status = SUPINE_OK;
  const char *name = path == NULL ? NULL : PyBytes_AsString(path);
  Py_BEGIN_ALLOW_THREADS status =
      name != NULL ? supine_basis_open_with(name, &options, &self->basis, &error)
                   : supine_basis_open_memory_with(self->bytes.buf, (size_t)self->bytes.len,
                                                   &options, &self->basis, &error);
  Py_END_ALLOW_THREADS Py_CLEAR(path);
  if (status != SUPINE_OK) {
    (void)supine_python_raise(status, &error);
    goto fail;
  }
  self->info = supine_basis_get_info(self->basis);
  return (PyObject *)self;

fail:
  Py_XDECREF(path);
  Py_DECREF(self);
  return NULL;
}

static void handle_free(PyObject *object) {
  handle *self = (handle *)object;
  PyTypeObject *type = Py_TYPE(object);
  supine_basis_close(self->basis);
  if (self->bytes.obj != NULL) {
    PyBuffer_Release(&self->bytes);
  }
  PyObject_Free(self);
  Py_DECREF(type);
}

static PyObject *handle_info(PyObject *self, PyObject *unused) {
  (void)unused;
  const supine_basis_info *info = ((handle *)self)->info;
  PyObject *names = PyTuple_New((Py_ssize_t)info->lung_count);
  PyObject *begins = PyTuple_New((Py_ssize_t)info->lung_count + 1);
  for (size_t i = 0; names != NULL && begins != NULL && i <= info->lung_count; ++i) {
    PyObject *begin = PyLong_FromSize_t(info->lung_begin[i]);
    PyObject *name = i == info->lung_count
                         ? NULL
                         : PyUnicode_DecodeUTF8(info->lung_names[i],
                                                (Py_ssize_t)strlen(info->lung_names[i]), "replace");
    if (begin == NULL || PyTuple_SetItem(begins, (Py_ssize_t)i, begin) != 0 ||
        (i < info->lung_count &&
         (name == NULL || PyTuple_SetItem(names, (Py_ssize_t)i, name) != 0))) {
      Py_CLEAR(begins);
    }
  }
  if (names == NULL || begins == NULL) {
    Py_XDECREF(names);
    Py_XDECREF(begins);
    return NULL;
  }
  return Py_BuildValue("{s:n,s:n,s:n,s:n,s:n,s:N,s:N,s:O,s:O,s:i,s:i,s:d,s:d,s:d}", "vertex_count",
                       (Py_ssize_t)info->vertex_count, "triangle_count",
                       (Py_ssize_t)info->triangle_count, "mode_count", (Py_ssize_t)info->mode_count,
                       "band", (Py_ssize_t)info->band, "normal_count",
                       (Py_ssize_t)info->normal_count, "lung_names", names, "lung_begin", begins,
                       "vector", info->vector ? Py_True : Py_False, "has_volume",
                       info->has_volume ? Py_True : Py_False, "storage", (int)info->storage, "simd",
                       (int)info->simd, "bytes_per_vertex", info->bytes_per_vertex, "storage_error",
                       info->storage_error, "scan_volume", info->scan_volume);
}

static PyObject *handle_metadata(PyObject *self, PyObject *unused) {
  (void)unused;
  size_t count = 0;
  const supine_metadata *all = supine_basis_all_metadata(((handle *)self)->basis, &count);
  PyObject *made = PyDict_New();
  for (size_t i = 0; made != NULL && i < count; ++i) {
    PyObject *value =
        PyUnicode_DecodeUTF8(all[i].value, (Py_ssize_t)strlen(all[i].value), "replace");
    if (value == NULL || PyDict_SetItemString(made, all[i].key, value) != 0) {
      Py_CLEAR(made);
    }
    Py_XDECREF(value);
  }
  return made;
}

static PyObject *handle_tensor(PyObject *self, PyObject *arguments) {
  const char *name = NULL;
  if (!PyArg_ParseTuple(arguments, "s", &name)) {
    return NULL;
  }
  const supine_tensor *tensor = supine_basis_tensor(((handle *)self)->basis, name);
  if (tensor == NULL) {
    Py_RETURN_NONE;
  }
  return supine_python_block(self, tensor->data, supine_python_type_of((int)tensor->dtype),
                             tensor->rank, tensor->shape);
}

static PyObject *handle_bounds(PyObject *self, PyObject *unused) {
  (void)unused;
  const supine_basis_info *info = ((handle *)self)->info;
  return supine_python_block(self, info->bounds, 'f', 3, (size_t[]){info->lung_count, 2, 3});
}

/* Once a frame. */

static PyObject *handle_weights(PyObject *self, PyObject *arguments) {
  const handle *of = (handle *)self;
  PyObject *from = NULL;
  PyObject *out = NULL;
  Py_buffer view;
  double gravity[3];
  if (!PyArg_ParseTuple(arguments, "OO", &from, &out) || !supine_python_gravity(from, gravity) ||
      !supine_python_array(out, "out", 'd', of->info->mode_count, true, &view)) {
    return NULL;
  }
  const supine_status status = supine_basis_weights(of->basis, gravity, view.buf);
  PyBuffer_Release(&view);
  if (status != SUPINE_OK) {
    const supine_error error = {status, "gravity has no direction: it is zero or not finite"};
    return supine_python_raise(status, &error);
  }
  Py_RETURN_NONE;
}

static PyObject *handle_resting_volume(PyObject *self, PyObject *from) {
  double gravity[3];
  double volume = 0.0;
  if (!supine_python_gravity(from, gravity)) {
    return NULL;
  }
  const supine_status status =
      supine_basis_resting_volume(((handle *)self)->basis, gravity, &volume);
  if (status != SUPINE_OK) {
    const supine_error error = {status, "gravity has no direction: it is zero or not finite"};
    return supine_python_raise(status, &error);
  }
  return PyFloat_FromDouble(volume);
}

/* Weights, a number and a lung, where None is all of them (the lungs' count). */
static bool parse_lung(const handle *of, PyObject *arguments, double *weights, double *number,
                       size_t *lung) {
  PyObject *from = NULL;
  PyObject *which = Py_None;
  if (!PyArg_ParseTuple(arguments, "Od|O", &from, number, &which) ||
      !supine_python_numbers(from, "weights", of->info->mode_count, weights)) {
    return false;
  }
  *lung = of->info->lung_count;
  if (which == Py_None) {
    return true;
  }
  const Py_ssize_t given = PyNumber_AsSsize_t(which, PyExc_IndexError);
  if (given < 0 || (size_t)given >= of->info->lung_count) {
    if (PyErr_Occurred() == NULL) {
      PyErr_Format(PyExc_IndexError, "lung %zd of %zu", given, of->info->lung_count);
    }
    return false;
  }
  *lung = (size_t)given;
  return true;
}

static PyObject *handle_scale(PyObject *self, PyObject *arguments) {
  const handle *of = (handle *)self;
  double weights[SUPINE_MODES_MAX];
  double volume = 0.0;
  double scale = 0.0;
  size_t lung = 0;
  if (!parse_lung(of, arguments, weights, &volume, &lung)) {
    return NULL;
  }
  supine_error error = {SUPINE_OK, ""};
  const supine_status status =
      lung == of->info->lung_count
          ? supine_basis_scale(of->basis, weights, volume, &scale, &error)
          : supine_basis_lung_scale(of->basis, lung, weights, volume, &scale, &error);
  return status == SUPINE_OK ? PyFloat_FromDouble(scale) : supine_python_raise(status, &error);
}

static PyObject *handle_volume(PyObject *self, PyObject *arguments) {
  const handle *of = (handle *)self;
  double weights[SUPINE_MODES_MAX];
  double scale = 0.0;
  size_t lung = 0;
  if (!parse_lung(of, arguments, weights, &scale, &lung)) {
    return NULL;
  }
  if (!of->info->has_volume) {
    return supine_python_raise(SUPINE_ERROR_OPEN_SURFACE, NULL);
  }
  double volume = 0.0;
  for (size_t i = 0; i < of->info->lung_count; ++i) {
    if (lung == i || lung == of->info->lung_count) {
      volume += supine_basis_lung_volume(of->basis, i, weights, scale);
    }
  }
  return PyFloat_FromDouble(volume);
}

static PyObject *handle_error(PyObject *self, PyObject *arguments) {
  const handle *of = (handle *)self;
  PyObject *from[2] = {NULL, NULL};
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  if (!PyArg_ParseTuple(arguments, "OO", &from[0], &from[1]) ||
      !supine_python_numbers(from[0], "weights", of->info->mode_count, weights) ||
      !supine_python_scales(from[1], of->info->lung_count, scales)) {
    return NULL;
  }
  return PyFloat_FromDouble(supine_basis_error(of->basis, weights, scales));
}

/* Every vertex. */

/* What these calls are given: weights, scales, a range, and arrays for what they write. */
typedef struct call {
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX];
  size_t begin, end;
  Py_buffer xyz, normals; /* obj NULL: not given */
} call;

static bool range_fits(const handle *of, Py_ssize_t begin, Py_ssize_t end) {
  if (begin >= 0 && begin <= end && (size_t)end <= of->info->vertex_count) {
    return true;
  }
  PyErr_Format(PyExc_IndexError, "vertices %zd to %zd of %zu", begin, end, of->info->vertex_count);
  return false;
}

static void call_end(call *made) {
  if (made->xyz.obj != NULL) {
    PyBuffer_Release(&made->xyz);
  }
  if (made->normals.obj != NULL) {
    PyBuffer_Release(&made->normals);
  }
}

/* Arguments: weights, scales, begin, end, xyz and, where there are six, normals. */
static bool call_begin(const handle *of, PyObject *const *arguments, Py_ssize_t given, call *made) {
  made->xyz = made->normals = (Py_buffer){0};
  if (given != 5 && given != 6) {
    PyErr_Format(PyExc_TypeError, "%zd arguments, where 5 or 6 are taken", given);
    return false;
  }
  const Py_ssize_t begin = PyNumber_AsSsize_t(arguments[2], PyExc_IndexError);
  const Py_ssize_t end = PyNumber_AsSsize_t(arguments[3], PyExc_IndexError);
  if (PyErr_Occurred() != NULL ||
      !supine_python_numbers(arguments[0], "weights", of->info->mode_count, made->weights) ||
      !supine_python_scales(arguments[1], of->info->lung_count, made->scales) ||
      !range_fits(of, begin, end)) {
    return false;
  }
  made->begin = (size_t)begin;
  made->end = (size_t)end;
  const size_t count = 3 * (made->end - made->begin);
  if (arguments[4] != Py_None &&
      !supine_python_array(arguments[4], "out", 'f', count, true, &made->xyz)) {
    made->xyz.obj = NULL;
    return false;
  }
  if (given == 6 && arguments[5] != Py_None &&
      !supine_python_array(arguments[5], "normals", 'f', count, true, &made->normals)) {
    made->normals.obj = NULL;
    call_end(made);
    return false;
  }
  return true;
}

typedef void range_function(const supine_basis *basis, const double *weights, const double *scales,
                            size_t begin, size_t end, float *xyz);

static PyObject *run_range(PyObject *self, PyObject *const *arguments, Py_ssize_t given,
                           range_function *run) {
  const handle *of = (handle *)self;
  call made;
  if (!call_begin(of, arguments, given, &made)) {
    return NULL;
  }
  if (made.xyz.obj == NULL) {
    call_end(&made);
    PyErr_SetString(PyExc_TypeError, "out must be an array");
    return NULL;
  }
  Py_BEGIN_ALLOW_THREADS run(of->basis, made.weights, made.scales, made.begin, made.end,
                             made.xyz.buf);
  Py_END_ALLOW_THREADS call_end(&made);
  Py_RETURN_NONE;
}

static PyObject *handle_deform(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
  return run_range(self, arguments, given, supine_deform_range);
}

static PyObject *handle_displace(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
  return run_range(self, arguments, given, supine_displace_range);
}

static PyObject *handle_deform_lit(PyObject *self, PyObject *const *arguments, Py_ssize_t given) {
  const handle *of = (handle *)self;
  call made;
  if (!call_begin(of, arguments, given, &made)) {
    return NULL;
  }
  if (made.normals.obj == NULL) {
    call_end(&made);
    PyErr_SetString(PyExc_TypeError, "normals must be an array");
    return NULL;
  }
  supine_status status = SUPINE_OK;
  Py_BEGIN_ALLOW_THREADS status = supine_deform_lit_range(
      of->basis, made.weights, made.scales, made.begin, made.end, made.xyz.buf, made.normals.buf);
  Py_END_ALLOW_THREADS call_end(&made);
  if (status != SUPINE_OK) {
    const supine_error error = {status, "the basis was made or opened without normals: normals() "
                                        "computes them from the triangles"};
    return supine_python_raise(status, &error);
  }
  Py_RETURN_NONE;
}

static PyObject *handle_deform_batch(PyObject *self, PyObject *arguments) {
  const handle *of = (handle *)self;
  PyObject *from[3];
  Py_buffer view[3] = {{0}, {0}, {0}};
  Py_ssize_t count = 0;
  Py_ssize_t begin = 0;
  Py_ssize_t end = 0;
  PyObject *result = NULL;
  if (!PyArg_ParseTuple(arguments, "nOOnnO", &count, &from[0], &from[1], &begin, &end, &from[2]) ||
      !range_fits(of, begin, end)) {
    return NULL;
  }
  const size_t sizes[3] = {(size_t)count * of->info->mode_count,
                           (size_t)count * of->info->lung_count,
                           (size_t)count * 3 * (size_t)(end - begin)};
  static const char *const names[3] = {"weights", "scales", "out"};
  for (size_t i = 0; i < 3; ++i) {
    if (!supine_python_array(from[i], names[i], i == 2 ? 'f' : 'd', sizes[i], i == 2, &view[i])) {
      view[i].obj = NULL;
      goto cleanup;
    }
  }
  Py_BEGIN_ALLOW_THREADS supine_deform_batch(of->basis, (size_t)count, view[0].buf, view[1].buf,
                                             (size_t)begin, (size_t)end, view[2].buf);
  Py_END_ALLOW_THREADS result = Py_NewRef(Py_None);

cleanup:
  for (size_t i = 0; i < 3; ++i) {
    if (view[i].obj != NULL) {
      PyBuffer_Release(&view[i]);
    }
  }
  return result;
}

static PyObject *handle_normals(PyObject *self, PyObject *arguments) {
  const handle *of = (handle *)self;
  PyObject *from[2];
  Py_buffer xyz;
  Py_buffer normals;
  const size_t count = 3 * of->info->vertex_count;
  if (!PyArg_ParseTuple(arguments, "OO", &from[0], &from[1]) ||
      !supine_python_array(from[0], "xyz", 'f', count, false, &xyz)) {
    return NULL;
  }
  const bool fits = supine_python_array(from[1], "out", 'f', count, true, &normals);
  if (fits) {
    Py_BEGIN_ALLOW_THREADS supine_normals(of->basis, xyz.buf, normals.buf);
    Py_END_ALLOW_THREADS PyBuffer_Release(&normals);
  }
  PyBuffer_Release(&xyz);
  return fits ? Py_NewRef(Py_None) : NULL;
}

/* Calls that take no tuple have a type of their own. */
#define FAST(function) ((PyCFunction)(void (*)(void))(function))

PyObject *supine_python_basis_type(void) {
  static PyMethodDef methods[] = {
      {"info", handle_info, METH_NOARGS, "numbers of supine_basis_info"},
      {"metadata", handle_metadata, METH_NOARGS, "supine_basis_all_metadata"},
      {"tensor", handle_tensor, METH_VARARGS, "supine_basis_tensor, or None"},
      {"bounds", handle_bounds, METH_NOARGS, "info's bounds"},
      {"weights", handle_weights, METH_VARARGS, "supine_basis_weights"},
      {"resting_volume", handle_resting_volume, METH_O, "supine_basis_resting_volume"},
      {"scale", handle_scale, METH_VARARGS, "supine_basis_scale, supine_basis_lung_scale"},
      {"volume", handle_volume, METH_VARARGS, "supine_basis_lung_volume"},
      {"error", handle_error, METH_VARARGS, "supine_basis_error"},
      {"deform", FAST(handle_deform), METH_FASTCALL, "supine_deform_range"},
      {"displace", FAST(handle_displace), METH_FASTCALL, "supine_displace_range"},
      {"deform_lit", FAST(handle_deform_lit), METH_FASTCALL, "supine_deform_lit_range"},
      {"deform_batch", handle_deform_batch, METH_VARARGS, "supine_deform_batch"},
      {"normals", handle_normals, METH_VARARGS, "supine_normals"},
      {NULL, NULL, 0, NULL}};
  static PyType_Slot slots[] = {{Py_tp_new, (void *)handle_new},
                                {Py_tp_dealloc, (void *)handle_free},
                                {Py_tp_methods, (void *)methods},
                                {Py_tp_doc, (void *)"An open basis, as supine.Basis uses it."},
                                {0, NULL}};
  static PyType_Spec spec = {"supine._supine.Basis", sizeof(handle), 0, Py_TPFLAGS_DEFAULT, slots};
  return PyType_FromSpec(&spec);
}
