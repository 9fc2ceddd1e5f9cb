/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Read what is to move inside the lungs: named points, meshes, or the nodes of a grid. */
#ifndef SUPINE_INSIDE_CONTENT_H
#define SUPINE_INSIDE_CONTENT_H

#include "mesh/image/image.h"
#include "precompute/inside/shells.h"

/** Points inside the lungs, some of which may be corners of triangles. Each named point and each
 * mesh is one part. Zero-initialise; supine_inside_content_free releases it. */
typedef struct supine_inside_content {
  size_t count;
  double *points; /**< [count, 3] mm, LPS */
  uint32_t *part; /**< [count] index of the named point, mesh or grid node of each point */
  size_t triangle_count;
  uint32_t *triangles; /**< [triangle_count, 3] indices of points */
  size_t part_count;   /**< number of named points and meshes; 0 for a grid */
  char *names;         /**< names of the parts in order, separated by newlines */
  size_t rigid_count;  /**< number of rigid pieces: parts, or components of a part */
  uint32_t *rigid;     /**< [count] 1 + index of the rigid piece of each point, whose points follow
                          each other; 0 if the point deforms. Unused for a grid */
  supine_image grid;   /**< for a grid: numbers of nodes, position of the first node, and steps */
  double unseen;       /**< share of the lungs' vertices outside the image of the grid; else 0 */
} supine_inside_content;

/** Append each point of a file as one part. Options as supine_io_points_read. */
supine_status supine_inside_content_points(const char *path,
                                           const supine_mesh_load_options *options,
                                           supine_inside_content *content, supine_error *error);

/** Append a mesh as one part, named after its file. Options as supine_mesh_load. */
supine_status supine_inside_content_mesh(const char *path, const supine_mesh_load_options *options,
                                         supine_inside_content *content, supine_error *error);

/** Append a surface as one part of the given name. */
supine_status supine_inside_content_surface(const char *name, const supine_mesh *mesh,
                                            supine_inside_content *content, supine_error *error);

/** Make each compact component of the meshes a rigid piece (supine_mesh_find_compact). Where a mesh
 * has other components, too, its points are put in another order, the rigid pieces first. */
supine_status supine_inside_content_find_compact(supine_inside_content *content,
                                                 supine_error *error);

/** Make further parts rigid pieces: each moves as a whole, but keeps its shape.
 * @param names  part names separated by commas, or "all" */
supine_status supine_inside_content_make_rigid(supine_inside_content *content, const char *names,
                                               supine_error *error);

/** Make a grid of nodes. Keep the nodes inside the lungs, and the nodes outside whose distance from
 * a lung is less than the diagonal of a grid cell. Then every point inside a lung lies between
 * nodes.
 *
 * @param like     image whose voxels are the nodes, or every n-th voxel along an axis if `spacing`
 *                 is n voxels. The grid continues beyond the image where that does not reach far
 *                 enough, has axes at right angles even if the image (a tilted CT) does not, and is
 *                 right-handed. If NULL, the axes of the grid are x, y and z
 * @param spacing  distance between nodes, mm; with `like`, rounded to a multiple of its spacing
 * @param margin   distance, mm, by which the grid extends beyond the nodes around the lungs
 * @param content  zero-initialised */
supine_status supine_inside_content_grid(const supine_inside_shells *shells,
                                         const supine_image *like, double spacing, double margin,
                                         supine_inside_content *content, supine_error *error);

/** Check that every part has a name of its own. */
supine_status supine_inside_content_check_names(const supine_inside_content *content,
                                                supine_error *error);

void supine_inside_content_free(supine_inside_content *content);

#endif
