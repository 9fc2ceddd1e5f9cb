/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a basis file of lungs, for tests and benchmarks. */
#ifndef SUPINE_BASIS_HELPERS_H
#define SUPINE_BASIS_HELPERS_H

#include <stdlib.h>

#include "precompute/precompute.h"

static inline supine_status helper_write_basis(const char *path, const supine_prepared *prepared,
                                               const supine_basis_choice *choice,
                                               supine_basis_report *report, supine_error *error) {
  supine_bytes bytes = {.data = NULL};
  supine_status status = supine_precompute(prepared, choice, &bytes, report, error);
  if (status == SUPINE_OK) {
    status = supine_precompute_save(path, &bytes, error);
  }
  free(bytes.data);
  return status;
}

#endif
