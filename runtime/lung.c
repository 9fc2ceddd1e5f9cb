/* SPDX-License-Identifier: MIT */
/* Return the weights of one lung, and its volume as a polynomial of its gains. */
#include "runtime/internal.h"

const double *supine_basis_lung_weights(const supine_basis *basis, const supine_pose *pose,
                                        size_t lung) {
  return pose->weights + (basis->info.order > 0 ? lung * basis->info.mode_count : 0);
}

void supine_basis_contract(const supine_basis *basis, size_t lung, const double *weights,
                           supine_volume_form *form) {
  const size_t k = basis->info.mode_count;
  *form = (supine_volume_form){{0}};
  supine_volume_contract(k, basis->info.volume_linear + lung * 3 * k,
                         basis->info.volume_quadratic + lung * 3 * k * k,
                         basis->info.volume_cubic + lung * k * k * k, weights, form);
}
