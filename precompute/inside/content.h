/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Read the content that a basis moves: named points, meshes, or the nodes of a grid. */
#ifndef SUPINE_INSIDE_CONTENT_H
#define SUPINE_INSIDE_CONTENT_H

#include "mesh/io/image.h"
#include "precompute/inside/shells.h"

/** Points, some of which may be corners of triangles. Zero-initialise;
 * supine_inside_content_free releases it. */
typedef struct supine_inside_content {
  size_t count;
  double *points; /**< [count, 3] mm, LPS */
  uint32_t *part; /**< [count] index of the point's part or, in a grid, of its node */
  size_t triangle_count;
  uint32_t *triangles; /**< [triangle_count, 3] indices of points */
  size_t part_count;   /**< number of named parts; 0 for a grid */
  char *names;         /**< names of the parts in order, separated by newlines */
  bool *rigid;         /**< [part_count] whether the part keeps its shape; NULL if none does */
  supine_image grid;   /**< if the content is a grid: size, origin and step of its nodes */
} supine_inside_content;

/** Append the points of a file, each as one part; for options and statuses see
 * supine_mesh_points_read. */
supine_status supine_inside_content_points(const char *path,
                                           const supine_mesh_load_options *options,
                                           supine_inside_content *content, supine_error *error);

/** Append a mesh as one part, named after its file; for options and statuses see
 * supine_mesh_load. */
supine_status supine_inside_content_mesh(const char *path, const supine_mesh_load_options *options,
                                         supine_inside_content *content, supine_error *error);

/** Append a surface as one part of the given name.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_inside_content_surface(const char *name, const supine_mesh *mesh,
                                            supine_inside_content *content, supine_error *error);

/** Make parts rigid.
 * @param names  part names separated by commas, or "all"
 * @retval SUPINE_ERROR_ARGUMENT  no part has that name
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_inside_content_make_rigid(supine_inside_content *content, const char *names,
                                               supine_error *error);

/** Make a grid of all nodes inside the lungs, and of the nodes outside that are nearer to a lung
 * than the sum of a cell's three edges, so that every point inside lies between nodes.
 *
 * @param like     image of which every n-th voxel along each axis is a node; NULL: along x, y, z
 * @param spacing  distance between nodes, mm; with `like`, rounded to a multiple of its spacing
 * @param margin   distance, mm, by which the grid extends beyond the lungs' box
 * @param content  zero-initialised
 * @retval SUPINE_ERROR_ARGUMENT  a spacing that is not positive, more than 2^31 nodes
 * @retval SUPINE_ERROR_MESH      no node is inside a lung
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_inside_content_grid(const supine_inside_shells *shells,
                                         const supine_image *like, double spacing, double margin,
                                         supine_inside_content *content, supine_error *error);

void supine_inside_content_free(supine_inside_content *content);

#endif
