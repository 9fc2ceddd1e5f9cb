/* SPDX-License-Identifier: MIT */
/* Vertex attributes and uniforms for supine.glsl. */
#include <string.h>

#include "runtime/internal.h"

supine_status supine_gl_pack(const supine_basis *basis, size_t begin, size_t end,
                             float *attributes) {
  const size_t modes = basis->info.mode_count;
  if (basis->info.vector || modes > SUPINE_GL_MODES) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  float *to = attributes;
  for (size_t i = begin; i < end; ++i, to += SUPINE_GL_FLOATS) {
    memcpy(to, basis->info.vertices + 3 * i, 3 * sizeof *to);
    memcpy(to + 3, basis->info.direction + 3 * i, 3 * sizeof *to);
    memset(to + 6, 0, SUPINE_GL_MODES * sizeof *to);
    memcpy(to + 6, basis->info.coefficients + i * modes, modes * sizeof *to);
  }
  return SUPINE_OK;
}

supine_status supine_gl_weights(const supine_basis *basis, const double *weights, double scale,
                                float *uniforms) {
  if (basis->info.vector || basis->info.mode_count > SUPINE_GL_MODES) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  for (size_t k = 0; k < SUPINE_GL_MODES; ++k) {
    uniforms[k] = k < basis->info.mode_count ? (float)(scale * weights[k]) : 0;
  }
  return SUPINE_OK;
}
