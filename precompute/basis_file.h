/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Print a basis file. */
#ifndef SUPINE_BASIS_FILE_H
#define SUPINE_BASIS_FILE_H

#include "precompute/computed.h"

/** Bytes in memory, which free() releases. */
typedef struct supine_bytes {
  char *data;
  size_t size;
} supine_bytes;

/** Add the error of storage to computed->accuracy, and print the basis file.
 * @param prepared  texts and model
 * @param bytes     release bytes->data with free(), also after an error */
supine_status supine_precompute_print(const supine_prepared *prepared,
                                      const supine_basis_choice *choice, supine_computed *computed,
                                      supine_bytes *bytes, supine_error *error);

#endif
