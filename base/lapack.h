/* SPDX-License-Identifier: MIT */
/** @file Convert the result of a LAPACKE function to a status. */
#ifndef SUPINE_LAPACK_H
#define SUPINE_LAPACK_H

#include <lapacke.h>

#include <supine/status.h>

/** Convert the return value `info` of a LAPACKE function to a status: SUPINE_ERROR_MEMORY if a work
 * array could not be allocated, SUPINE_ERROR_NUMERICAL for all other errors. */
static inline supine_status supine_lapack_status(lapack_int info) {
  return info == 0 ? SUPINE_OK
         : info == LAPACK_WORK_MEMORY_ERROR || info == LAPACK_TRANSPOSE_MEMORY_ERROR
             ? SUPINE_ERROR_MEMORY
             : SUPINE_ERROR_NUMERICAL;
}

#endif
