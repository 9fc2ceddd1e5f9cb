/* SPDX-License-Identifier: MIT */
/** @file Lists of named points, written by hand or by 3D Slicer. */
#ifndef SUPINE_MESH_POINTS_H
#define SUPINE_MESH_POINTS_H

#include "mesh/mesh.h"

typedef struct supine_io_points {
  size_t count;
  double *at;   /**< [count, 3] positions, mm, LPS */
  double *from; /**< [count, 3] source of the line of sight of each point, as `at`; NAN without */
  char **names; /**< [count] "1", "2", ... if the file has no names; never NULL */
} supine_io_points;

/** Read points from a CSV file with the columns x,y,z and optionally name (or label) and
 * from_x,from_y,from_z (the point lies on the line from there through x,y,z), or from files of 3D
 * Slicer: .mrk.json and .fcsv (placed control points, in the file's coordinate system), and tables
 * with the columns l,p,s or r,a,s.
 * @param options  axes and unit to use instead of the file's; NULL for the file's own
 * @param points   zero-initialised; written only on success */
supine_status supine_io_points_read(const char *path, const supine_mesh_load_options *options,
                                    supine_io_points *points, supine_error *error);
void supine_io_points_free(supine_io_points *points);

/** Return whether the name ends in .csv, .fcsv or .json. */
bool supine_io_points_named(const char *path);

#endif
