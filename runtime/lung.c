/* SPDX-License-Identifier: MIT */
/* The lung of a vertex, the lungs that a state names, the weights of one lung, and its volume as a
 * polynomial. */
#include <string.h>

#include "runtime/internal.h"
#include "runtime/lung.h"

size_t supine_basis_lung_of(const supine_basis_info *info, size_t vertex) {
  size_t lung = 0;
  while (vertex >= info->lung_begin[lung + 1]) {
    ++lung;
  }
  return lung;
}

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

supine_status supine_basis_find_lungs(const supine_basis *basis, const supine_state *state,
                                      size_t lungs[SUPINE_LUNGS_MAX], supine_error *error) {
  const size_t count = basis->info.lung_count;
  bool named[SUPINE_LUNGS_MAX] = {false};
  if (state->lung_count != count) {
    return supine_error_set(
        error, SUPINE_ERROR_ARGUMENT,
        "not all %zu lungs are named once: the state names %zu; name all of them", count,
        state->lung_count);
  }
  for (size_t i = 0; i < count; ++i) {
    size_t lung = 0;
    while (lung < count && strcmp(state->lungs[i].name, basis->info.lung_names[lung]) != 0) {
      ++lung;
    }
    if (lung == count || named[lung]) {
      return supine_error_set(
          error, SUPINE_ERROR_ARGUMENT,
          "lung '%s' is unknown or named twice; name each lung of this basis once: %s%s%s",
          state->lungs[i].name, basis->info.lung_names[0], count > 1 ? " and " : "",
          count > 1 ? basis->info.lung_names[1] : "");
    }
    named[lung] = true;
    lungs[i] = lung;
  }
  return SUPINE_OK;
}
