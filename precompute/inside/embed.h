/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Embed points and meshes (content.h) in the lungs, so that they move with the lungs. For
 * each mode, the displacement of a point interpolates the displacement of the surface of its lung
 * (biharmonic.h). The result is a basis of the kind "vector": each mode has a displacement
 * vector for each point. It has the modes, volume tensors and metadata of the surface's basis, so
 * the mode weights and gains (factors of displacement) of a pose apply to both.
 *
 * The interpolation b is exact only at some of the vertices of the surface (the centres). Near the
 * surface, the displacement u of a point x is b(x), corrected by the error of b at the surface
 * point q nearest to x:
 *
 *     u(x) = b(x) + (1 - t)^2 (1 + 2 t) (s(q) - b(q)),    t = |x - q| / reach < 1
 *
 *     s(q)   displacement of q, interpolated linearly in its triangle
 *     reach  twice the sum of the mean edge length and the spacing of the centres, mm
 *
 * So points on the surface move exactly with the surface.
 *
 * A rigid piece belongs to the lung with most of its vertices (runtime/rigid.h).
 *
 * Positions x are given in the scan. The new basis stores positions at full inflation, like the
 * basis of the surface: x minus the displacement u(x) in the scan. */
#ifndef SUPINE_INSIDE_EMBED_H
#define SUPINE_INSIDE_EMBED_H

#include <supine/findings.h>

#include "precompute/inside/content.h"
#include "precompute/inside/shells.h"

/** Default maximum number of centres of a lung (vertices at which the interpolation is exact). On
 * two lungs of 20,000 vertices with a smoothing length of 10 mm (reach), the error is 0.2 % of
 * the displacement at the other vertices, and 0.05 % inside; this takes a few seconds. */
enum { SUPINE_INSIDE_CENTRES = 4000 };

/** A displacement of the lungs that is known at every point, not only on the surface.
 * @param point  position in the scan, mm
 * @param side   lung of the point: +1 left, -1 right
 * @param u      written: displacement by all modes with their weights in the scan's posture, mm */
typedef void supine_inside_field(const void *context, const double point[3], double side,
                                 double u[3]);

typedef struct supine_inside_options {
  supine_inside_field *field; /**< if not NULL, replaces the interpolated displacement: points keep
                                 the interpolated dependence on gravity, as a factor on u */
  const void *context;        /**< argument of `field` */
  bool clamp;     /**< whether points outside a lung move like the surface point nearest to them */
  size_t centres; /**< most interpolation centres per lung; 0 for SUPINE_INSIDE_CENTRES */
  const char *made_by; /**< program that writes the basis file, for the metadata; optional */
} supine_inside_options;

typedef struct supine_inside_report {
  size_t count;                     /**< number of embedded points */
  size_t in_lung[SUPINE_LUNGS_MAX]; /**< number of points that move with each lung */
  size_t outside;                   /**< number of points outside every lung */
  size_t farthest;          /**< index of the outside point that is farthest from the lungs */
  double farthest_mm;       /**< distance of the farthest outside point from the lungs, mm */
  size_t rigid;             /**< number of rigid pieces of more than one vertex */
  supine_findings findings; /**< warnings about parts that hardly belong to these lungs */
} supine_inside_report;

/** Embed the points of `content` in the lungs, and write them as a new basis file. The file has
 * these additional tensors, for N points and R rigid pieces:
 *
 *     part       U32 [N]     index of the named point or mesh; in a grid, index of the grid node
 *     depth      F32 [N]     mm below the surface in the scan, negative outside
 *     names      U8 [bytes]  names of points and meshes, separated by newlines (not for a grid)
 *     anatomy    U8 [parts]  1: airways, a lobe, ...; 0: a target (anatomy.h; not for a grid)
 *     rigid      U32 [R, 2]  vertices begin <= i < end of each rigid piece (if there are any)
 *     grid       F64 [4, 3]  position of the first node, then the three steps, mm (for a grid)
 *     grid_size  U32 [3]     number of nodes along the three steps (for a grid)
 *     lungs_box  F64 [2, 3]  corners of the box around the lungs' surface, mm
 *     lungs_squares  F64 [lungs, 3, K, K]
 *         for each lung, axis and two of K modes: the sum over its vertices of the product of their
 *         displacements by these modes, divided by the number of vertices of all lungs, mm^2
 *
 * The tensors lungs_* give the expected errors of the points (supine/locate.h).
 * The metadata "content" is "points", "mesh" or "grid". Uses all cores; cost: see biharmonic.h.
 * Fails with SUPINE_ERROR_MESH if every point is more than 60 mm outside, unless they are clamped.
 */
supine_status supine_inside_embed(const supine_inside_shells *shells,
                                  const supine_inside_content *content,
                                  const supine_inside_options *options, const char *path,
                                  supine_inside_report *report, supine_error *error);

#endif
