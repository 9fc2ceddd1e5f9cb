/* SPDX-License-Identifier: MIT */
/** @file
 * What an open basis holds, for the files of this folder. */
#ifndef SUPINE_RUNTIME_INTERNAL_H
#define SUPINE_RUNTIME_INTERNAL_H

#include <supine/runtime.h>
#include <supine/safetensors.h>

struct supine_basis {
  supine_basis_info info;
  size_t lung_begin[SUPINE_LUNGS_MAX + 1];
  supine_safetensors *file;
  const float *vertices;     /**< [N, 3] */
  const uint32_t *triangles; /**< [M, 3] */
  const float *direction;    /**< [N, 3], or NULL where the kind is vector */
  const float *coefficients; /**< [N, K], or [N, 3, K] where the kind is vector */
  const double *modes;       /**< [K, (L+1)^2] */
  const double *linear;      /**< [G, K], mL, or NULL; likewise: */
  const double *quadratic;   /**< [G, K, K] */
  const double *cubic;       /**< [G, K, K, K] */
};

#endif
