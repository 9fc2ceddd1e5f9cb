/* SPDX-License-Identifier: MIT */
/* Numbers, arrays, directions and scales as people write them in Python. */
#include <string.h>

#include <supine/posture.h>

#include "runtime/python/python.h"

/* Whether an element is of that type, in this machine's order. */
static bool is_type(const char *format, char type) {
  const bool prefix = format != NULL && (format[0] == '@' || format[0] == '=' || format[0] == '<');
  return format != NULL && format[prefix] == type && format[prefix + 1] == '\0';
}

bool supine_python_array(PyObject *from, const char *name, char type, size_t count, bool writable,
                         Py_buffer *view) {
  const int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0);
  if (PyObject_GetBuffer(from, view, flags) != 0) {
    return false;
  }
  if (is_type(view->format, type) &&
      (size_t)view->len == count * (type == 'f' ? sizeof(float) : sizeof(double))) {
    return true;
  }
  PyBuffer_Release(view);
  PyErr_Format(PyExc_ValueError, "%s must be an array of %zu numbers of type float%d", name, count,
               type == 'f' ? 32 : 64);
  return false;
}

bool supine_python_numbers(PyObject *from, const char *name, size_t count, double *values) {
  Py_buffer view;
  if (PyObject_CheckBuffer(from) &&
      PyObject_GetBuffer(from, &view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) == 0) {
    const bool fits =
        is_type(view.format, 'd') && (size_t)view.len == count * sizeof *values && view.ndim > 0;
    if (fits) {
      memcpy(values, view.buf, count * sizeof *values);
    }
    PyBuffer_Release(&view);
    if (fits) {
      return true;
    }
  }
  PyErr_Clear();
  const Py_ssize_t length = PySequence_Size(from);
  if (length < 0 || (size_t)length != count) {
    PyErr_Format(PyExc_ValueError, "%s must be %zu numbers", name, count);
    return false;
  }
  for (Py_ssize_t i = 0; i < length; ++i) {
    PyObject *item = PySequence_GetItem(from, i);
    values[i] = item == NULL ? -1.0 : PyFloat_AsDouble(item);
    Py_XDECREF(item);
    if (PyErr_Occurred() != NULL) {
      return false;
    }
  }
  return true;
}

bool supine_python_gravity(PyObject *from, double gravity[3]) {
  if (!PyUnicode_Check(from)) {
    return supine_python_numbers(from, "gravity", 3, gravity);
  }
  PyObject *text = PyUnicode_AsUTF8String(from);
  const char *name = text == NULL ? NULL : PyBytes_AsString(text);
  const bool known = name != NULL && supine_posture_gravity(name, gravity) == SUPINE_OK;
  if (name != NULL && !known) {
    supine_error error = {SUPINE_ERROR_ARGUMENT, ""};
    (void)supine_error_set(&error, SUPINE_ERROR_ARGUMENT, "no posture '%.64s': did you mean '%s'?",
                           name, supine_posture_nearest(name));
    (void)supine_python_raise(SUPINE_ERROR_ARGUMENT, &error);
  }
  Py_XDECREF(text);
  return known;
}

bool supine_python_scales(PyObject *from, size_t lungs, double *scales) {
  if (!PyFloat_Check(from) && PySequence_Check(from)) {
    return supine_python_numbers(from, "scales", lungs, scales);
  }
  const double scale = PyFloat_AsDouble(from);
  for (size_t lung = 0; lung < lungs; ++lung) {
    scales[lung] = scale;
  }
  return PyErr_Occurred() == NULL;
}
