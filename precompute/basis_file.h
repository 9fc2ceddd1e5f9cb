/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Writing a basis file. */
#ifndef SUPINE_BASIS_FILE_H
#define SUPINE_BASIS_FILE_H

#include "precompute/fields.h"
#include "precompute/physics/model.h"
#include "precompute/physics/reference.h"

#include "precompute/projection/error_table.h"

typedef struct supine_basis_content {
  const supine_lungs *lungs;
  const supine_model *model;    /* NULL: fields from elsewhere */
  const supine_fit_report *fit; /* of those */
  const double *directions;     /* [N, 3]; NULL: a vector field */
  const supine_compression *compression;
  const supine_volume_forms *forms; /* of the coefficients; NULL: open surface */
  const supine_accuracy *accuracy;
  const supine_reference *reference; /* full inflation; NULL: the scan is the reference */
  const double *resting;             /* [G, 9] with it: volumes at rest, harmonics, mL */
  const double *turned_over;         /* optional, see supine_accuracy_turned_over */
  const supine_error_table *table;   /* optional */
  bool harmonics;                    /* the modes are the harmonics themselves */
  const char *patient;               /* a person's own law, JSON; optional */
  double expected_error;             /* mm of square error per mm of displacement; 0: the law's */
  const char *patient_summary;       /* whose, and how well it held out */
  const char *assumed;               /* optional */
  const char *findings;              /* lines; NULL or "": none */
  supine_scan_frame frame;
  const char *made_by; /* optional */
} supine_basis_content;

supine_status supine_writer_basis_write(const char *path, const supine_basis_content *content,
                                        supine_error *error);

#endif
