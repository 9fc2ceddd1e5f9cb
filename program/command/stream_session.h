/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run a server that follows a tracked patient, and report what it did. */
#ifndef SUPINE_STREAM_SESSION_H
#define SUPINE_STREAM_SESSION_H

#include "program/options/pv.h"
#include "program/options/state_options.h"
#include "program/stream/tracked_patient.h"

typedef struct supine_stream_session {
  supine_stream_options options; /* without volume, observed points, page and callbacks */
  supine_state volume;           /* fixed volume, if `has_volume` */
  bool has_volume, has_breath;   /* whether options of the volume or of the breath are given */
  bool allow_folds;              /* whether states that lungs cannot hold are allowed */
  const char *pv;                /* file of the pressure-volume relation, or NULL */
  supine_pv_breath breath;
  const char *web, *certificate, *key; /* address and encryption of the page; NULL if not given */
  const char *web_host;                /* host names of the page, separated by commas, or NULL */
  supine_from from;
  const char *points; /* file of the observed points, or NULL */
  double noise;       /* standard deviation of an observed coordinate, mm */
} supine_stream_session;

/* Follow the patient until interrupted. */
supine_status supine_command_stream_run(const supine_stream_session *wanted,
                                        const supine_basis *basis, supine_error *error);

#endif
