/* SPDX-License-Identifier: MIT */
/** @file Find the axes of lungs from their shape. */
#ifndef SUPINE_MESH_ANATOMY_H
#define SUPINE_MESH_ANATOMY_H

#include "mesh/mesh.h"

typedef struct supine_mesh_anatomy {
  supine_axes axes; /**< axes that fit the shape best if clearly better than LPS, otherwise LPS */
  bool certain;     /**< whether `axes` fit the shape clearly better than all other axes */
  int side;         /**< +1 left, -1 right; 0 if unknown, for two lungs, or if `axes` are not LPS */
  bool joined;      /**< whether a single surface seems to hold both lungs */
} supine_mesh_anatomy;

/** Find the axes from third moments of the volume. A lung is narrow at the head, reaches lowest at
 * the back, and is hollow towards the heart. The right lung is larger than the left lung, which
 * leaves room for the heart.
 * @param lungs  [count] one or two surfaces, each a lung */
supine_mesh_anatomy supine_mesh_anatomy_find(const supine_mesh *lungs, size_t count);

#endif
