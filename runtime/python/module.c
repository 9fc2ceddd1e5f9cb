/* SPDX-License-Identifier: MIT */
/* The extension module supine._supine: what supine/__init__.py stands on. */
#include <string.h>

#include <supine/breath.h>
#include <supine/posture.h>
#include <supine/version.h>

#include "runtime/python/python.h"

static PyObject *three(const double gravity[3]) {
  return Py_BuildValue("(ddd)", gravity[0], gravity[1], gravity[2]);
}

static PyObject *gravity_of(PyObject *module, PyObject *from) {
  (void)module;
  double gravity[3];
  return supine_python_gravity(from, gravity) ? three(gravity) : NULL;
}

static PyObject *quaternion(PyObject *module, PyObject *from) {
  (void)module;
  double turn[4];
  double gravity[3];
  if (!supine_python_numbers(from, "quaternion", 4, turn)) {
    return NULL;
  }
  const supine_status status = supine_posture_quaternion(turn, gravity);
  return status == SUPINE_OK ? three(gravity) : supine_python_raise(status, NULL);
}

static PyObject *tilt(PyObject *module, PyObject *arguments) {
  (void)module;
  PyObject *from = NULL;
  double degrees = 0.0;
  double gravity[3];
  if (!PyArg_ParseTuple(arguments, "Od", &from, &degrees) ||
      !supine_python_gravity(from, gravity)) {
    return NULL;
  }
  const supine_status status = supine_posture_tilt(gravity, degrees, gravity);
  return status == SUPINE_OK ? three(gravity) : supine_python_raise(status, NULL);
}

static PyObject *postures(PyObject *module, PyObject *unused) {
  (void)module;
  (void)unused;
  const size_t count = supine_posture_count();
  PyObject *names = PyTuple_New((Py_ssize_t)count);
  for (size_t i = 0; names != NULL && i < count; ++i) {
    PyObject *name = PyUnicode_FromString(supine_posture_name(i));
    if (name == NULL || PyTuple_SetItem(names, (Py_ssize_t)i, name) != 0) {
      Py_CLEAR(names);
    }
  }
  return names;
}

/* supine_breath_evaluate: a breath's five numbers, its relation (None: the normal adult's), times
 * and what they give. */
static PyObject *breath(PyObject *module, PyObject *arguments) {
  (void)module;
  supine_pv_breath wanted = supine_breath_default();
  supine_pv pv = *supine_breath_normal();
  double numbers[sizeof pv / sizeof(double)];
  int course = 0;
  Py_ssize_t count = 0;
  PyObject *from[3] = {NULL, NULL, NULL};
  Py_buffer times;
  Py_buffer volumes;
  if (!PyArg_ParseTuple(arguments, "ddddiOnOO", &wanted.tidal, &wanted.rate,
                        &wanted.inhale_fraction, &wanted.rest_pressure, &course, &from[0], &count,
                        &from[1], &from[2])) {
    return NULL;
  }
  wanted.course = (supine_pv_course)course;
  if (from[0] != Py_None) {
    if (!supine_python_numbers(from[0], "pv", sizeof numbers / sizeof *numbers, numbers)) {
      return NULL;
    }
    memcpy(&pv, numbers, sizeof pv);
  }
  if (!supine_python_array(from[1], "times", 'd', (size_t)count, false, &times)) {
    return NULL;
  }
  if (!supine_python_array(from[2], "out", 'd', (size_t)count, true, &volumes)) {
    PyBuffer_Release(&times);
    return NULL;
  }
  supine_error error = {SUPINE_OK, ""};
  const supine_status status =
      supine_breath_evaluate(&pv, &wanted, (size_t)count, times.buf, volumes.buf, NULL, &error);
  PyBuffer_Release(&volumes);
  PyBuffer_Release(&times);
  return status == SUPINE_OK ? Py_NewRef(Py_None) : supine_python_raise(status, &error);
}

static bool add_type(PyObject *module, const char *name, PyObject *type) {
  const bool added = type != NULL && PyModule_AddObjectRef(module, name, type) == 0;
  Py_XDECREF(type);
  return added;
}

PyMODINIT_FUNC PyInit__supine(void) {
  static PyMethodDef functions[] = {
      {"gravity", gravity_of, METH_O, "supine_posture_gravity, or three numbers as they are"},
      {"quaternion", quaternion, METH_O, "supine_posture_quaternion"},
      {"tilt", tilt, METH_VARARGS, "supine_posture_tilt"},
      {"breath", breath, METH_VARARGS, "supine_breath_evaluate"},
      {"postures", postures, METH_NOARGS, "every supine_posture_name"},
      {NULL, NULL, 0, NULL}};
  static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT,
                                          "supine._supine",
                                          "The C library, call by call.",
                                          -1,
                                          functions,
                                          NULL,
                                          NULL,
                                          NULL,
                                          NULL};
  PyObject *module = PyModule_Create(&definition);
  if (module == NULL || !supine_python_errors_add(module) ||
      !add_type(module, "Block", supine_python_block_type()) ||
      !add_type(module, "Basis", supine_python_basis_type()) ||
      PyModule_AddStringConstant(module, "version", supine_version()) != 0) {
    Py_XDECREF(module);
    return NULL;
  }
  return module;
}
