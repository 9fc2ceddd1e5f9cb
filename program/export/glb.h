/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * A glTF binary file being made, for the files that make its parts. */
#ifndef SUPINE_EXPORT_GLB_H
#define SUPINE_EXPORT_GLB_H

#include <jansson.h>

#include "program/export/targets.h"

/** What arrays hold. Unless the file is plain, places are stored as counts and normals as bytes,
 * and all but numbers and rotations are compressed. */
typedef enum glb_kind {
  GLB_CORNERS,  /**< uint32_t: vertex numbers of triangles */
  GLB_PLACES,   /**< float [3], mm */
  GLB_NORMALS,  /**< float [3], unit */
  GLB_CHANGES,  /**< float [3], what a target adds to normals */
  GLB_COLOURS,  /**< uint8_t [4], linear */
  GLB_NUMBERS,  /**< float, of animations */
  GLB_ROTATIONS /**< float [4], quaternions X, Y, Z, W */
} glb_kind;

/** The file's parts. */
typedef struct glb {
  const export_source *source;
  const export_glb_options *options;
  export_targets targets;
  double step; /**< mm per stored unit of places */
  json_t *views, *accessors, *meshes, *nodes, *materials, *animations;
  FILE *numbers;        /**< the buffer */
  size_t unpacked;      /**< bytes of the compressed arrays when decoded */
  supine_status status; /**< of memory */
} glb;

/** Vertices of a lung or of what is inside it, and how they are drawn. */
typedef struct glb_shape {
  const char *name;
  const export_source *source;
  size_t lung;
  const float *normals;           /**< [N, 3] of all of the source's vertices */
  const float *added;             /**< [count, N, 3] what targets add to them, or NULL */
  const uint8_t *colours;         /**< [N, 4], or NULL */
  size_t parts;                   /**< primitives, each of a material */
  const uint32_t *const *corners; /**< of each part, vertex numbers of the source */
  const size_t *corner_count;
  const json_int_t *material;
} glb_shape;

/** Append an array and return its accessor's index. */
json_int_t supine_export_glb_put(glb *g, glb_kind kind, const void *rows, size_t count);

/** Append a mesh and the node that shows it, in mm LPS from the lungs' middle; return the node's
 * index. @param mesh  taken over */
json_int_t supine_export_glb_show(glb *g, const char *name, json_t *mesh);

/** Append a shape with morph targets; return its node's index. */
json_int_t supine_export_glb_add(glb *g, const glb_shape *shape);

/** Append a material and return its index; below an `alpha` of 1 it is seen through. */
json_int_t supine_export_glb_material(glb *g, const char *name, const double rgb[3], double alpha);

/** Return the extras of the file: how weights follow from gravity and volume. */
json_t *supine_export_glb_extras(const glb *g, double largest_move);

/** Return the extras of a lung's mesh. */
json_t *supine_export_glb_lung_extras(const glb *g, size_t lung);

/** Compute the rotation X, Y, Z, W of the node "patient", who lies down and has turned about the
 * body's long axis by `roll`: pi / 2 is the left side. */
void supine_export_glb_rotation(double roll, float q[4]);

/** Append the animations. @param nodes  [count] with targets, of lungs [count] */
void supine_export_glb_animate(glb *g, size_t count, const json_int_t *nodes, const size_t *lungs);

/** Append what is inside the lungs, for each lung that has something; nodes and lungs get an entry
 * each. */
void supine_export_glb_inside(glb *g, size_t *count, json_int_t *nodes, size_t *lungs);

/** Append a table and an arrow that shows gravity; return their nodes as an array. */
json_t *supine_export_glb_room(glb *g);

#endif
