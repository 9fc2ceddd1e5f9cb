/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a basis as options say, for the command `supine precompute` and for the offline library. */
#ifndef SUPINE_OFFLINE_BASIS_H
#define SUPINE_OFFLINE_BASIS_H

#include <stdio.h>

#include "precompute/precompute.h"
#include "program/options/option.h"

typedef struct supine_offline_request {
  supine_model_choice model;
  supine_basis_choice basis;
  const char *path;             /* of the basis file */
  const char *fields, *patient; /* paths, or NULL */
  bool has_band, has_modes;
  size_t directions;            /* number of directions of gravity to print; 0 to make a basis */
  supine_scan posture;          /* with `fields`: the posture of the scan */
  supine_patient_record record; /* content of `patient` */
} supine_offline_request;

/* Option table that fills a supine_offline_request, and its defaults. */
extern const supine_option supine_offline_options[];
void supine_offline_begin(void *request);

/* Check that the options agree, and read the patient's file. Call this before
 * supine_precompute_prepare. */
supine_status supine_offline_check(supine_offline_request *wanted, supine_error *error);

/* Make and write the basis, and print a report of it to `out`. */
supine_status supine_offline_write(const supine_offline_request *wanted, supine_prepared *prepared,
                                   FILE *out, supine_error *error);

#endif
