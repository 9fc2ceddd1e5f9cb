/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Find vertices that a simulator displaced unlike their neighbours. */
#ifndef SUPINE_NODES_H
#define SUPINE_NODES_H

#include "precompute/fields/fields.h"

/** The vertex that differs most from its neighbours. */
typedef struct supine_stray {
  size_t run, vertex;
  double apart_mm; /**< distance of its displacement from the mean of its neighbours */
  double ratio;    /**< this distance / largest distance of a neighbour from the mean; 0 if no
                        distance is above a tenth of the RMS displacement */
} supine_stray;

/** Find the vertex and the run with the largest ratio.
 * @param rms_mm  RMS displacement of all runs
 * @param found   written */
supine_status supine_fields_find_stray(const supine_fields *fields, const supine_lungs *lungs,
                                       double rms_mm, supine_stray *found);

#endif
