/* SPDX-License-Identifier: MIT */
/** @file
 * Small defects of surfaces that can be mended without a doubt. */
#ifndef SUPINE_MESH_REPAIR_H
#define SUPINE_MESH_REPAIR_H

#include "mesh/mesh.h"

typedef struct supine_mesh_repair_report {
  size_t duplicates; /**< triangles dropped: an earlier one has the same corners */
  size_t loose;      /**< dropped: faces too many, none of whose edges has just two triangles */
  size_t reversed;   /**< triangles whose corners were reordered to face as most of their surface */
  size_t parted;     /**< vertices doubled, in which closed surfaces touched */
} supine_mesh_repair_report;

/** Mends a surface in place. One without these defects stays as it is, bit by bit.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_mesh_repair(supine_mesh *mesh, supine_mesh_repair_report *report);

/** Drops connected pieces whose volume is below this share of all pieces' volume.
 * @param pieces  written: how many stay
 * @param specks  written: how many were dropped
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_mesh_drop_specks(supine_mesh *mesh, double share, size_t *pieces,
                                      size_t *specks);

#endif
