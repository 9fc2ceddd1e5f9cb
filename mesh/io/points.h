/* SPDX-License-Identifier: MIT */
/** @file
 * Lists of named points, as people write them by hand and 3D Slicer by itself. */
#ifndef SUPINE_MESH_POINTS_H
#define SUPINE_MESH_POINTS_H

#include "mesh/mesh.h"

typedef struct supine_mesh_points {
  size_t count;
  double *at;   /**< [count, 3] mm, LPS */
  char **names; /**< [count] never NULL; numbers from 1 where the file has none */
} supine_mesh_points;

/** Reads points from a CSV file with the columns x,y,z and perhaps name (or label), or from 3D
 * Slicer's .fcsv or .mrk.json (control points that are placed; its coordinate system is heeded).
 * @param options  axes and units, in place of what the file says; NULL: none
 * @param points   zero-initialised; written on success alone
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY */
supine_status supine_mesh_points_read(const char *path, const supine_mesh_load_options *options,
                                      supine_mesh_points *points, supine_error *error);
void supine_mesh_points_free(supine_mesh_points *points);

/** Does the name end in .csv, .fcsv or .json? */
bool supine_mesh_points_named(const char *path);

#endif
