/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Parts of a glTF binary file on its way, for the files that write them. */
#ifndef SUPINE_EXPORT_GLB_H
#define SUPINE_EXPORT_GLB_H

#include "sh/base/output.h"
#include <jansson.h>

#include "program/export/targets.h"

/** glTF's numbers for component types and buffer targets. */
enum { GLTF_SHORT = 5122, GLTF_UINT = 5125, GLTF_FLOAT = 5126 };
enum { GLTF_NO_TARGET = 0, GLTF_VERTICES = 34962, GLTF_INDICES = 34963 };

/** What the file's buffer will hold, in order. */
typedef struct glb_plan {
  json_t *views;
  json_t *accessors;
  size_t bytes;
} glb_plan;

/** Appends a view and its accessor of `count` elements; the accessor's index. `type` is SCALAR,
 * VEC3 or VEC4; low and high are its bounds, `axes` numbers each, or NULL. */
size_t supine_export_glb_plan_add(glb_plan *plan, int component, const char *type, size_t count,
                                  int target, size_t axes, const double *low, const double *high);

/** Bounds of `count` points, as they will stand in the file. */
void supine_export_glb_bounds(const float *xyz, size_t count, bool rounded, double low[3],
                              double high[3]);

/** An array of numbers. */
json_t *supine_export_glb_numbers(const double *values, size_t count);

/** What the mesh's `extras` say: names, and how weights follow from gravity and volume. */
json_t *supine_export_glb_extras(const export_source *source, const export_glb_options *options,
                                 const export_targets *targets);

/** The patient on the back turns over the left side onto the belly and over the right side back,
 * and breathes. */
typedef struct glb_animation {
  size_t frames;
  float *times;     /**< [frames], s */
  float *weights;   /**< [frames, J] */
  float *rotations; /**< [frames, 4], quaternions X, Y, Z, W of the patient's node */
} glb_animation;

/** @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_export_glb_animation_make(const export_source *source,
                                               const export_glb_options *options,
                                               const export_targets *targets,
                                               glb_animation *animation, supine_error *error);
void supine_export_glb_animation_free(glb_animation *animation);

/** Plans its three accessors and returns the "animations" array; `nodes` 2: node 2 has the same
 * weights as node 1. */
json_t *supine_export_glb_animation_plan(const glb_animation *animation, size_t targets,
                                         size_t nodes, glb_plan *plan);

/** What is inside the lungs, ready for the file. */
typedef struct glb_inside {
  export_source source; /**< the content, with balls for points; what it has is this struct's: */
  supine_basis_info info;
  float *vertices, *normals; /**< [N, 3] */
  float *coefficients;       /**< [N, 3, K] */
  uint32_t *corners;         /**< [M, 3] part by part */
  size_t part_count;         /**< primitives */
  size_t *part_begin;        /**< [part_count + 1] of corners */
  const export_parts *parts;
  float *xyz; /**< [N, 3] space */
} glb_inside;

/** @param inside  zero-initialised
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_export_glb_inside_make(const export_source *content, const export_parts *parts,
                                            glb_inside *inside, supine_error *error);
void supine_export_glb_inside_free(glb_inside *inside);
/** Plans its accessors and returns its mesh, without weights; materials count from `material`. */
json_t *supine_export_glb_inside_plan(glb_inside *inside, const export_targets *targets,
                                      json_int_t material, glb_plan *plan);
json_t *supine_export_glb_inside_materials(const glb_inside *inside);
void supine_export_glb_inside_write(glb_inside *inside, const export_targets *targets, FILE *file);

#endif
