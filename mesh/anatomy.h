/* SPDX-License-Identifier: MIT */
/** @file Find the axes of lungs from their shape. */
#ifndef SUPINE_MESH_ANATOMY_H
#define SUPINE_MESH_ANATOMY_H

#include "mesh/mesh.h"

typedef struct supine_mesh_anatomy {
  supine_axes axes; /**< axes that the shape fits best; LPS unless others fit clearly better */
  bool certain;     /**< no other axes fit nearly as well */
  int side;         /**< side of a single lung in LPS: +1 left, -1 right, 0 unknown */
  bool joined;      /**< a single surface seems to hold both lungs */
} supine_mesh_anatomy;

/** Find the axes by third moments of volume: lungs are narrow at the head, reach deepest at the
 * back and are hollow towards the heart; the right lung is the larger, and the heart lies in the
 * left.
 * @param lungs  [count] one or two surfaces, each a lung */
supine_mesh_anatomy supine_mesh_anatomy_find(const supine_mesh *lungs, size_t count);

#endif
