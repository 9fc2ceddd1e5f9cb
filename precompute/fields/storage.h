/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Choose whether a basis of another simulator's fields stores modes or clusters. */
#ifndef SUPINE_FIELDS_STORAGE_H
#define SUPINE_FIELDS_STORAGE_H

#include "precompute/clusters/clusters.h"
#include "precompute/fields/fields.h"

/** How a basis stores the displacements of its vertices. */
typedef enum supine_warp_storage {
  SUPINE_FIELD_STORAGE_BEST,     /**< clusters if their error is small beside that of the modes */
  SUPINE_FIELD_STORAGE_MODES,    /**< a vector for each mode and vertex */
  SUPINE_FIELD_STORAGE_CLUSTERS, /**< clusters, as many as their error demands */
  SUPINE_FIELD_STORAGE_COUNT
} supine_warp_storage;

/** Find clusters for the modes of a fit. Those of BEST raise the error of the fit by half at most,
 * to 0.2 mm at most, and their seams are at most 1 % of an edge; they have 64 vertices or more on
 * average. Those of CLUSTERS may have fewer, 8 or more, and err more if that is not enough.
 * @param compression  of the fit
 * @param clusters     written: `count` is 0 if the basis stores modes; release it with
 *   supine_clusters_free, also after an error */
supine_status supine_fields_cluster(const supine_fit *fit, const supine_compression *compression,
                                    supine_warp_storage storage, supine_clusters *clusters,
                                    supine_error *error);

#endif
