/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * What lies inside the lungs, made to move with them: every point's displacement is the biharmonic
 * interpolation of its lung's surface's (biharmonic.h), mode by mode, so that the result is a basis
 * of kind vector with the modes, volume forms and metadata of the surface's. The same weights and
 * scales move both.
 *
 * Near the surface, what the interpolation leaves there is added,
 *
 *     u(x) = b(x) + (1 - t)^2 (1 + 2 t) (s(q) - b(q)),    t = |x - q| / depth < 1
 *
 * with q the surface's point nearest to x and s(q) its motion, linear in its triangle: what is on
 * the surface moves with it exactly, although the centres of b are some of its vertices.
 *
 * Rigid parts go into the lung that most of their vertices are in (runtime/rigid.h).
 *
 * Content is given where the scan has it, and x, q are there. The file holds it at full inflation,
 * as it does every surface: x less u at the scan's weights and scale. */
#ifndef SUPINE_INSIDE_EMBED_H
#define SUPINE_INSIDE_EMBED_H

#include "precompute/inside/content.h"
#include "precompute/inside/shells.h"

/** The surface's vertices that the interpolation goes through, at most, lung by lung. On two lungs
 * of 20,000 vertices whose forces reach 10 mm that leaves 0.2 % of the motion at the others and
 * 0.05 % inside, and takes a few seconds. */
enum { SUPINE_INSIDE_CENTRES = 4000 };

typedef struct supine_inside_options {
  bool clamp;          /**< what is outside moves as the nearest point of the surface */
  size_t centres;      /**< 0: SUPINE_INSIDE_CENTRES */
  const char *made_by; /**< for the file's metadata; optional */
} supine_inside_options;

/** What became of the content. */
typedef struct supine_inside_report {
  size_t count; /**< points in the file */
  size_t
      in_lung[SUPINE_LUNGS_MAX]; /**< of them, by lung: the one that they are in, or nearest to */
  size_t outside;      /**< points outside of every lung; of a grid: nodes of its margin */
  size_t farthest;     /**< that of them which is farthest, as it was given */
  double farthest_mm;  /**< and how far that is */
  size_t rigid;        /**< parts of several vertices that keep their size */
  size_t centres;      /**< of the interpolation, all lungs */
  size_t surface;      /**< vertices of the lungs in question */
  double left_percent; /**< what the interpolation alone leaves at them, RMS, of the RMS motion */
} supine_inside_report;

/** Embeds content in the lungs of an open basis and writes the basis file that moves it: besides
 * what every basis has, tensors
 *
 *     part   U32 [N]  which name a point goes by; of a grid, its node
 *     depth  F32 [N]  mm below the surface in the scan, negative outside
 *     names  U8 [.]   the parts' names, separated by newlines (not of a grid)
 *     rigid  U32 [R, 2] vertices begin <= i < end of each rigid part (where there is one)
 *     grid   F64 [4, 3] origin and the three steps, mm; grid_size U32 [3] (of a grid)
 *
 * and the metadata "content": "points", "mesh" or "grid".
 * @param content  points are left as they are
 * @retval SUPINE_ERROR_MESH  no content
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY, SUPINE_ERROR_WRITE
 * Cost: see biharmonic.h; in parallel. */
supine_status supine_inside_embed(const supine_inside_shells *shells,
                                  const supine_inside_content *content,
                                  const supine_inside_options *options, const char *path,
                                  supine_inside_report *report, supine_error *error);

#endif
