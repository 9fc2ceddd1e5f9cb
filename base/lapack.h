/* SPDX-License-Identifier: MIT */
/** @file Convert the result of a LAPACKE function to a status. */
#ifndef SUPINE_LAPACK_H
#define SUPINE_LAPACK_H

#include <lapacke.h>

#include <supine/status.h>

/** Convert the return value `info` of a LAPACKE function to a status: SUPINE_ERROR_MEMORY if a work
 * array could not be allocated, SUPINE_ERROR_NUMERICAL for all other errors. */
static inline supine_status supine_lapack_status(lapack_int info) {
  switch (info) {
  case 0:
    return SUPINE_OK;
  case LAPACK_WORK_MEMORY_ERROR:
  case LAPACK_TRANSPOSE_MEMORY_ERROR:
    return SUPINE_ERROR_MEMORY;
  default:
    return SUPINE_ERROR_NUMERICAL;
  }
}

#endif
