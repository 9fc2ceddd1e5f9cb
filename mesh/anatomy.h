/* SPDX-License-Identifier: MIT */
/** @file
 * The axes that lungs seem to lie in, judged by their shape. */
#ifndef SUPINE_MESH_ANATOMY_H
#define SUPINE_MESH_ANATOMY_H

#include "mesh/mesh.h"

typedef struct supine_mesh_anatomy {
  supine_axes axes; /**< that the coordinates seem to be in; LPS: as they should be */
  bool certain;     /**< no other axes fit nearly as well */
  int side;         /**< of a single lung whose axes are LPS: +1 left, -1 right, 0 cannot be told */
  bool joined;      /**< a single surface that is wide enough to be both lungs in one */
} supine_mesh_anatomy;

/** Judges by third moments of volume: lungs are narrow at the head, reach deepest at the back and
 * are hollow towards the heart; the right lung is the larger, and the heart lies in the left.
 * `axes` differs from LPS only where other axes fit clearly better.
 * @param lungs  [count] one or two surfaces, each a lung */
supine_mesh_anatomy supine_mesh_anatomy_find(const supine_mesh *lungs, size_t count);

#endif
