/* SPDX-License-Identifier: MIT */
/** @file Reserve the buffers of OpenBLAS before its first use. */
#ifndef SUPINE_BLAS_H
#define SUPINE_BLAS_H

#include <stddef.h>

#include <supine/status.h>

/** Let OpenBLAS map the buffers that it needs to compute in several threads at once, and keeps
 * until the process ends. If it maps a buffer later and addresses or memory have run out, it tries
 * for ever.
 * @param threads  largest number of threads that call OpenBLAS at the same time, at most 256
 *
 * Thread-safe. A call costs nothing if an earlier one reserved as many.
 * @return SUPINE_ERROR_MEMORY if the buffers cannot be mapped; OpenBLAS must not be called then */
supine_status supine_blas_reserve(size_t threads, supine_error *error);

#endif
