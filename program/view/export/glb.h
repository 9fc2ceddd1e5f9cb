/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Declare the state and the functions with which glb.c and glb_*.c build a glTF binary file. */
#ifndef SUPINE_EXPORT_GLB_H
#define SUPINE_EXPORT_GLB_H

#include <jansson.h>

#include "base/arena.h"
#include "program/view/export/export.h"
#include "program/view/export/packed.h"
#include "program/view/export/targets.h"

/** Kinds of array in a glTF file; each comment names the type in memory. Unless
 * export_glb_options.plain is set, the file stores positions and weights as 16-bit integers and
 * normals as bytes, and compresses meshes. */
typedef enum glb_kind {
  GLB_CORNERS,        /**< uint32_t: vertex indices, three for each triangle */
  GLB_POSITIONS,      /**< float [3]: positions or displacements in units of glb.step */
  GLB_NORMALS,        /**< float [3]: unit normals */
  GLB_NORMAL_CHANGES, /**< float [3]: vectors that a morph target adds to normals */
  GLB_TIMES,          /**< float: times of an animation's frames, s */
  GLB_WEIGHTS,        /**< float: weights of morph targets in an animation, 0 to 1 */
  GLB_ROTATIONS       /**< float [4]: quaternions x, y, z, w */
} glb_kind;

/** State of a file while it is built. */
typedef struct glb {
  const supine_basis *basis;
  const supine_basis_info *info;
  const export_glb_options *options;
  export_targets targets;
  export_order order;
  float *xyz;     /**< [N, 3] workspace */
  float *normals; /**< [N, 3] unit normals of the base mesh */
  float *added; /**< [targets.count, N, 3] change of the normals by each morph target at weight 1 */
  double step;  /**< unit of stored positions and displacements, mm; 1 if options->plain */
  json_t *root; /**< JSON of the file, with the following arrays */
  json_t *views, *accessors, *meshes, *nodes, *materials;
  FILE *numbers;        /**< binary chunk of the file */
  size_t unpacked;      /**< total size of the compressed arrays after decompression, bytes */
  supine_status status; /**< SUPINE_ERROR_MEMORY if an allocation failed */
  supine_arena arena;   /**< memory of the arrays of this struct */
} glb;

/** Append an array of `count` elements, such as positions; return the index of its accessor.
 * @param order  [count] indices in `elements` of those to append; NULL for 0, 1, 2, ... */
json_int_t supine_export_glb_put(glb *g, glb_kind kind, const void *elements, const uint32_t *order,
                                 size_t count);

/** Append an accessor of `count` elements that are 0 without storing them; return its index. */
json_int_t supine_export_glb_put_zeros(glb *g, glb_kind kind, size_t count);

/** Append the mesh of a lung, with morph targets; return the index of its node. */
json_int_t supine_export_glb_add(glb *g, size_t lung);

/** Return the `extras` of the file, which say how to compute weights from gravity and volume. */
json_t *supine_export_glb_extras(const glb *g);

/** Return the `extras` of a lung's mesh: constants for the formulas in the `extras` of the file. */
json_t *supine_export_glb_lung_extras(const glb *g, size_t lung);

/** Compute the rotation of the node "patient" as a quaternion x, y, z, w. The patient lies on the
 * table, turned by `roll` radians about the body's long axis: 0 is supine, pi / 2 the left side. */
void supine_export_glb_rotation(double roll, float q[4]);

/** Append the animations of breathing. Node 0 must be the patient, node 1 + i must be lung i. */
void supine_export_glb_animate(glb *g);

/** Append a table under the patient and an arrow that shows gravity. Return the root nodes of the
 * scene: the patient, the table and the arrow. */
json_t *supine_export_glb_room(glb *g);

#endif
