/* SPDX-License-Identifier: MIT */
/** @file
 * What the files of the package's extension module share. */
#ifndef SUPINE_PYTHON_H
#define SUPINE_PYTHON_H

#ifndef PY_SSIZE_T_CLEAN
#define PY_SSIZE_T_CLEAN
#endif
#include <Python.h>

#include <stdbool.h>

#include <supine/status.h>

/** Makes the exceptions, one a status, and puts them into the module.
 * @return false with an exception set */
bool supine_python_errors_add(PyObject *module);
/** Raises the exception of a status with the C text (its own, where `error` has none).
 * @return NULL */
PyObject *supine_python_raise(supine_status status, const supine_error *error);

/** `count` numbers from an array or a sequence of them.
 * @param name  of the argument, for messages
 * @return false with an exception set */
bool supine_python_numbers(PyObject *from, const char *name, size_t count, double *values);
/** Gravity from a posture's name or three numbers; false with an exception set. */
bool supine_python_gravity(PyObject *from, double gravity[3]);
/** A breath scale for each lung, from one number for all or one for each; as above. */
bool supine_python_scales(PyObject *from, size_t lungs, double *scales);
/** The memory of an array of `count` numbers of a type ('f' or 'd'), in C order, to be released
 * with PyBuffer_Release; as above. */
bool supine_python_array(PyObject *from, const char *name, char type, size_t count, bool writable,
                         Py_buffer *view);

/** Memory that lives as long as `owner`, as an object that numpy takes without a copy, read-only.
 * @param type   of struct's: 'f', 'd', 'I', 'h', 'B'
 * @param shape  [rank], rank 1 to 4 */
PyObject *supine_python_block(PyObject *owner, const void *data, char type, size_t rank,
                              const size_t *shape);

/** The types; each NULL with an exception set. */
PyObject *supine_python_block_type(void);
PyObject *supine_python_basis_type(void);

/** What numpy and struct call an element; 0 for none of theirs. */
char supine_python_type_of(int dtype);

#endif
