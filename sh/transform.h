/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The spherical-harmonic transform of many real fields at once, in double precision.
 *
 *     coefficient(l, m) = integral over the sphere of value(g) Y(l, m)(g)         forward
 *
 * Fields are many and bands low, so the work is laid out across fields: FFTW along
 * longitude and a small matrix product for each order m along latitude, on blocks of fields that
 * stay in cache. A field never mixes with its neighbours: neither rounding nor NaN
 * passes from one to another.
 *
 * A plan is read-only once made: any number of threads may execute it. Making and destroying plans
 * calls FFTW's planner, which must not run in two threads at once. */
#ifndef SUPINE_TRANSFORM_H
#define SUPINE_TRANSFORM_H

#include <stddef.h>

#include "sh/grid.h"
#include <supine/status.h>

/** A plan for one band and one grid. */
typedef struct supine_sh_transform supine_sh_transform;

/** How a batch lies in memory, in doubles. Zero means the default in brackets.
 *
 *     values[(j * longitudes + k) * point_stride + field]
 *     coefficients[index * coefficient_stride + field * field_stride]
 *
 * The coefficients of a field may lie together (field_stride >= (band + 1)^2, the default) or the
 * fields of a coefficient (coefficient_stride >= fields, field_stride 1: the faster one). */
typedef struct supine_sh_batch {
  size_t fields;
  size_t point_stride;       /**< at least fields [fields] */
  size_t coefficient_stride; /**< [1] */
  size_t field_stride;       /**< [(band + 1)^2 where coefficient_stride is 0 or 1, else 1] */
  size_t threads;            /**< [supine_thread_count()] */
} supine_sh_batch;

/** Makes a plan. The grid is copied from; it need not outlive the call.
 *
 * @param band  0 to SUPINE_SH_BAND_MAX; the grid needs latitudes > band, longitudes > 2 band
 * @retval SUPINE_ERROR_ARGUMENT  band too high, or a grid too small for it
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_sh_transform_create(size_t band, const supine_sh_grid *grid,
                                         supine_sh_transform **plan, supine_error *error);

/** Frees a plan; NULL is legal. */
void supine_sh_transform_destroy(supine_sh_transform *plan);

/** Values on the whole grid to coefficients, which are overwritten.
 *
 * Exact to rounding for fields of the plan's band; of others, what lies beyond folds back.
 * Extra memory, however many fields: 0.5 MiB a thread at band 15 and 7 MiB at band 64, on the
 * grids of supine_sh_grid_size. Cost: that of reading the values and writing the coefficients once,
 * and about as much again in arithmetic; least where the strides are multiples of 8.
 * @retval SUPINE_ERROR_ARGUMENT  strides that overlap or overflow
 * @retval SUPINE_ERROR_MEMORY    nothing is written */
supine_status supine_sh_forward(const supine_sh_transform *plan, const supine_sh_batch *batch,
                                const double *values, double *coefficients, supine_error *error);

/** Adds latitude j's part of the forward transform to the coefficients, so that a caller who makes
 * one ring of the grid at a time never holds the whole. Zero the coefficients first; the rings may
 * come in any order, one call at a time for the same coefficients.
 *
 * @param ring  values at latitude j alone: ring[k * point_stride + field]
 * Statuses as supine_sh_forward; also ARGUMENT where there is no latitude j. */
supine_status supine_sh_forward_ring(const supine_sh_transform *plan, const supine_sh_batch *batch,
                                     size_t j, const double *ring, double *coefficients,
                                     supine_error *error);

#endif
