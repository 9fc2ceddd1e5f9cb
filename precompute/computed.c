/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compress displacements into modes, as the model and the fields of another simulator need. */
#include <stdlib.h>

#include "base/arena.h"
#include "precompute/computed.h"

void supine_precompute_computed_free(supine_computed *computed) {
  supine_projection_field_free(&computed->field);
  supine_sh_compression_free(&computed->compression);
  supine_physics_volume_forms_free(&computed->forms);
  supine_fields_fit_free(&computed->fit);
  supine_fields_free(&computed->counted);
  supine_clusters_free(&computed->clusters);
  free(computed->exact);
  supine_arena_free(&computed->memory);
}

supine_status supine_precompute_compress(const supine_basis_choice *choice,
                                         supine_computed *computed, supine_spectrum *spectrum,
                                         supine_error *error) {
  const supine_gravity_field *field = &computed->field;
  if (choice->modes == 0) {
    return supine_sh_compress_harmonics(&field->expansion, &computed->compression, error);
  }
  return supine_sh_compress_modes(&field->expansion, field->weight, choice->modes,
                                  &computed->compression, spectrum->singular, &spectrum->total,
                                  error);
}

void supine_precompute_drop_modes(const supine_basis_choice *choice,
                                  const supine_spectrum *spectrum, double relative,
                                  supine_computed *computed) {
  const size_t count = computed->compression.mode_count;
  if (choice->modes > 0 && !choice->keep_modes) {
    supine_sh_compression_truncate(
        &computed->compression, computed->field.expansion.rank,
        supine_sh_modes_needed(count, spectrum->singular, spectrum->total, relative));
  }
}

supine_status supine_precompute_tell_progress(const supine_basis_choice *choice, size_t done,
                                              supine_error *error) {
  enum { STEPS = 7 };
  bool wanted = true;
  if (choice->progress != NULL) {
    wanted = choice->progress(choice->progress_context, (double)done / STEPS);
  }
  SUPINE_REFUSE_IF(!wanted, error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
  return SUPINE_OK;
}
