/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a basis of prepared lungs, as options say, and report its errors. */
#include <string.h>

#include "precompute/make.h"

enum { BAND = 23, MODES = 16 }; /* defaults */

static bool go_on(void *context, double fraction) {
  const supine_precompute_options *options = context;
  return options->progress == NULL || options->progress(options->context, fraction) == 0;
}

/* Choose what the basis contains. */
static supine_status choose(const supine_precompute_modes *wanted, bool is_fields,
                            supine_basis_choice *choice, supine_error *error) {
  const bool has_band = wanted->has_band || wanted->band > 0;
  const bool has_modes = wanted->harmonics || wanted->count > 0;
  const size_t standard = is_fields ? SUPINE_MODES_MADE_MAX : MODES;
  SUPINE_REFUSE_IF(wanted->harmonics && wanted->count > 0, error, SUPINE_ERROR_ARGUMENT,
                   "give a number of modes or harmonics, not both");
  *choice = (supine_basis_choice){.band = has_band ? wanted->band : BAND,
                                  .modes = standard,
                                  .held_out = wanted->held_out,
                                  .without_normals = wanted->without_normals,
                                  .choose_band = is_fields && !has_band,
                                  .keep_modes = is_fields && has_modes};
  if (has_modes) {
    choice->modes = wanted->count; /* 0: harmonics */
  }
  return SUPINE_OK;
}

static void fill_report(const supine_prepared *prepared, const supine_basis_report *made,
                        supine_precompute_report *report) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const supine_accuracy *accuracy = &made->accuracy;
  const bool rest_known = prepared->reference.known;
  *report = (supine_precompute_report){
      .lung_count = lungs->lung_count,
      .vertex_count = lungs->mesh.vertex_count,
      .band = made->band,
      .mode_count = made->mode_count,
      .direction_count = accuracy->direction_count,
      .relative = {accuracy->relative_rms, accuracy->relative_p95, accuracy->relative_max},
      .mm = {accuracy->rms_mm, accuracy->p95_mm, accuracy->max_mm},
      .rest_known = rest_known,
      .rest_part = rest_known ? accuracy->volume : 0.0,
      .volume = rest_known ? 0.0 : accuracy->volume,
      .turned_over = made->turned_over};
}

supine_status supine_precompute_make(const supine_precompute_options *options,
                                     const supine_prepared *prepared, supine_bytes *bytes,
                                     supine_precompute_report *report, supine_error *error) {
  supine_precompute_options told = *options; /* of the progress */
  SUPINE_FREED_BY(supine_fields_free) supine_fields fields = {0};
  supine_basis_choice choice;
  supine_basis_report made;
  SUPINE_TRY(choose(&options->modes, options->fields != NULL, &choice, error));
  choice.made_by = options->made_by;
  choice.progress = go_on;
  choice.progress_context = &told;
  if (options->fields != NULL) {
    const supine_source *source = &prepared->source;
    SUPINE_TRY(supine_fields_load(options->fields, &source->lungs, &source->frame, &fields, error));
    choice.fields = &fields;
    choice.scan_gravity = prepared->posture.known ? prepared->posture.state.gravity : NULL;
  }
  SUPINE_TRY(supine_precompute(prepared, &choice, bytes, &made, error));
  fill_report(prepared, &made, report);
  if (options->fields != NULL) {
    report->band_count = made.fit.band_highest + 1;
    memcpy(report->band_error, made.fit.error, sizeof made.fit.error);
  }
  return SUPINE_OK;
}
