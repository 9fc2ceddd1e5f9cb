/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Embed content in the lungs so that it moves with them. A point's displacement is the
 * biharmonic interpolation of its lung's surface displacement (biharmonic.h), mode by mode. The
 * result is a basis of the kind "vector", with the modes, volume tensors and metadata of the
 * surface's basis, so that the weights and gains of a pose apply to both.
 *
 * The displacement u of a point x near the surface is the interpolation b, corrected by the error
 * of b at the surface point q nearest to x:
 *
 *     u(x) = b(x) + (1 - t)^2 (1 + 2 t) (s(q) - b(q)),    t = |x - q| / reach < 1
 *
 * where s(q) is the displacement of q (linear in a triangle), and reach is twice the sum of the
 * centres' spacing and the mean edge. So points on the surface move exactly with the surface,
 * although only some vertices are centres of b.
 *
 * A rigid part belongs to the lung with most of its vertices (runtime/rigid.h).
 *
 * Content is given as it is in the scan. The file holds it at full inflation, as a basis holds the
 * surface: each position x minus u(x) at the scan's weights and gains. */
#ifndef SUPINE_INSIDE_EMBED_H
#define SUPINE_INSIDE_EMBED_H

#include "precompute/inside/content.h"
#include "precompute/inside/shells.h"

/** Default largest number of vertices of a lung that are centres of the interpolation. On two lungs
 * of 20,000 vertices with a spreading length of 10 mm (--reach), the error is 0.2 % of the
 * displacement at vertices that are no centres, and 0.05 % inside; this takes a few seconds. */
enum { SUPINE_INSIDE_CENTRES = 4000 };

typedef struct supine_inside_options {
  bool clamp;     /**< whether points outside a lung move like the surface point nearest to them */
  size_t centres; /**< largest number of centres of one lung; 0 for SUPINE_INSIDE_CENTRES */
  const char *made_by; /**< program that writes the file, for its metadata; optional */
} supine_inside_options;

typedef struct supine_inside_report {
  size_t count;                     /**< number of points in the file */
  size_t in_lung[SUPINE_LUNGS_MAX]; /**< number of points in or nearest to each lung */
  size_t outside;                   /**< number of points outside every lung */
  size_t farthest;    /**< index of the outside point that is farthest from the lungs */
  double farthest_mm; /**< distance of the farthest outside point from the lungs, mm */
  size_t rigid;       /**< number of rigid parts of more than one vertex */
} supine_inside_report;

/** Embed content in the lungs of an open basis, and write a basis file of the content, with these
 * additional tensors, for N points and R rigid parts:
 *
 *     part       U32 [N]     index of the point's part; for a grid, of its node
 *     depth      F32 [N]     mm below the surface in the scan, negative outside
 *     names      U8 [bytes]  names of the parts, separated by newlines (not for a grid)
 *     rigid      U32 [R, 2]  vertices begin <= i < end of each rigid part (if there are any)
 *     grid       F64 [4, 3]  origin and the three steps, mm (for a grid)
 *     grid_size  U32 [3]     number of nodes along the three steps (for a grid)
 *
 * and the metadata "content": "points", "mesh" or "grid".
 * @retval SUPINE_ERROR_MESH  no content
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY, SUPINE_ERROR_WRITE
 * Cost: see biharmonic.h; in parallel. */
supine_status supine_inside_embed(const supine_inside_shells *shells,
                                  const supine_inside_content *content,
                                  const supine_inside_options *options, const char *path,
                                  supine_inside_report *report, supine_error *error);

#endif
