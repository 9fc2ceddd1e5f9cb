/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Find runs of a simulator that all others do not predict. */
#ifndef SUPINE_SUSPECTS_H
#define SUPINE_SUSPECTS_H

#include "precompute/fields/fields.h"

/** Take out the worst runs, one after the other, at most one for every 8 runs, and predict them
 * from the runs that are left, with the terms that suit these best. Write those whose error is
 * above a twentieth of the RMS displacement to the report (supine_fit_report.suspects).
 * @param fit     fitted
 * @param rms_mm  RMS displacement of all runs */
supine_status supine_fields_find_suspects(supine_fit *fit, double rms_mm);

#endif
