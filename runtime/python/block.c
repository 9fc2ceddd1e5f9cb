/* SPDX-License-Identifier: MIT */
/* Memory of an open basis as an object that numpy takes without a copy. */
#include <string.h>

#include <supine/safetensors.h>

#include "runtime/python/python.h"

typedef struct block {
  PyObject_HEAD PyObject *owner; /* kept while anyone looks */
  const void *data;
  char format[2];
  int rank;
  Py_ssize_t item;
  Py_ssize_t shape[SUPINE_TENSOR_RANK_MAX], strides[SUPINE_TENSOR_RANK_MAX];
} block;

static PyObject *block_type;

char supine_python_type_of(int dtype) {
  static const char types[SUPINE_DTYPE_COUNT] = {[SUPINE_U8] = 'B',
                                                 [SUPINE_U32] = 'I',
                                                 [SUPINE_F32] = 'f',
                                                 [SUPINE_F64] = 'd',
                                                 [SUPINE_I16] = 'h'};
  return (char)(dtype >= 0 && dtype < SUPINE_DTYPE_COUNT ? types[dtype] : '\0');
}

static Py_ssize_t item_size(char type) {
  return type == 'd' ? 8 : type == 'h' ? 2 : type == 'B' ? 1 : 4;
}

PyObject *supine_python_block(PyObject *owner, const void *data, char type, size_t rank,
                              const size_t *shape) {
  block *made = PyObject_New(block, (PyTypeObject *)block_type);
  if (made == NULL) {
    return NULL;
  }
  made->owner = Py_NewRef(owner);
  made->data = data;
  made->format[0] = type;
  made->format[1] = '\0';
  made->rank = (int)rank;
  made->item = item_size(type);
  Py_ssize_t stride = made->item;
  for (size_t i = rank; i-- > 0;) {
    made->shape[i] = (Py_ssize_t)shape[i];
    made->strides[i] = stride;
    stride *= made->shape[i];
  }
  return (PyObject *)made;
}

static void block_free(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  Py_DECREF(((block *)self)->owner);
  PyObject_Free(self);
  Py_DECREF(type);
}

static int block_buffer(PyObject *self, Py_buffer *view, int flags) {
  block *from = (block *)self;
  if ((flags & PyBUF_WRITABLE) != 0) {
    PyErr_SetString(PyExc_BufferError, "an open basis is read-only");
    view->obj = NULL;
    return -1;
  }
  Py_ssize_t length = from->item;
  for (int i = 0; i < from->rank; ++i) {
    length *= from->shape[i];
  }
  memset(view, 0, sizeof *view);
  view->obj = Py_NewRef(self);
  view->buf = (void *)from->data; /* read-only all the same */
  view->len = length;
  view->readonly = 1;
  view->itemsize = from->item;
  view->ndim = from->rank;
  view->format = (flags & PyBUF_FORMAT) != 0 ? from->format : NULL;
  view->shape = (flags & PyBUF_ND) != 0 ? from->shape : NULL;
  view->strides = (flags & PyBUF_STRIDES) == PyBUF_STRIDES ? from->strides : NULL;
  return 0;
}

PyObject *supine_python_block_type(void) {
  static PyType_Slot slots[] = {{Py_tp_dealloc, (void *)block_free},
                                {Py_bf_getbuffer, (void *)block_buffer},
                                {Py_tp_doc, (void *)"Memory of an open basis, read-only."},
                                {0, NULL}};
  static PyType_Spec spec = {"supine._supine.Block", sizeof(block), 0,
                             Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION, slots};
  block_type = PyType_FromSpec(&spec);
  return block_type;
}
