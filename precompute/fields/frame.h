/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Compare the axes of gravity with those of the displacements. */
#ifndef SUPINE_FRAME_H
#define SUPINE_FRAME_H

#include "precompute/fields/fields.h"

/** Measure how much gravity moves, and find the axes of gravity along which the lungs sag most
 * (supine_fit_report.frame). A fit without harmonics of degree 1 gains nothing.
 * @param fit  fitted */
supine_status supine_fields_find_frame(supine_fit *fit);

#endif
