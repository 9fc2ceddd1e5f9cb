/* SPDX-License-Identifier: MIT */
/* Statuses as exceptions: supine.Error, and one class a status that is also Python's own kind. */
#include "runtime/python/python.h"

static PyObject *errors[SUPINE_STATUS_COUNT];

static bool add(PyObject *module, supine_status status, const char *name, PyObject *base,
                PyObject *kind) {
  char full[64];
  (void)PyOS_snprintf(full, sizeof full, "supine.%s", name);
  PyObject *bases = PyTuple_Pack(2, base, kind);
  if (bases == NULL) {
    return false;
  }
  errors[status] = PyErr_NewExceptionWithDoc(full, supine_status_string(status), bases, NULL);
  Py_DECREF(bases);
  return errors[status] != NULL && PyModule_AddObjectRef(module, name, errors[status]) == 0;
}

bool supine_python_errors_add(PyObject *module) {
  errors[SUPINE_OK] = PyErr_NewExceptionWithDoc(
      "supine.Error", "What the C library refused; its text is the exception's.", NULL, NULL);
  PyObject *base = errors[SUPINE_OK];
  return base != NULL && PyModule_AddObjectRef(module, "Error", base) == 0 &&
         add(module, SUPINE_ERROR_ARGUMENT, "ArgumentError", base, PyExc_ValueError) &&
         add(module, SUPINE_ERROR_MEMORY, "OutOfMemoryError", base, PyExc_MemoryError) &&
         add(module, SUPINE_ERROR_READ, "ReadError", base, PyExc_OSError) &&
         add(module, SUPINE_ERROR_FORMAT, "FormatError", base, PyExc_ValueError) &&
         add(module, SUPINE_ERROR_MESH, "MeshError", base, PyExc_ValueError) &&
         add(module, SUPINE_ERROR_OPEN_SURFACE, "OpenSurfaceError", base, PyExc_ValueError) &&
         add(module, SUPINE_ERROR_UNSUPPORTED, "UnsupportedError", base,
             PyExc_NotImplementedError) &&
         add(module, SUPINE_ERROR_NUMERICAL, "NumericalError", base, PyExc_ArithmeticError);
}

PyObject *supine_python_raise(supine_status status, const supine_error *error) {
  const bool known =
      (int)status > SUPINE_OK && status < SUPINE_STATUS_COUNT && errors[status] != NULL;
  PyErr_SetString(errors[known ? status : SUPINE_OK], error != NULL && error->message[0] != '\0'
                                                          ? error->message
                                                          : supine_status_string(status));
  return NULL;
}
