/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the displacement of the lungs, and of targets inside them, in each posture from a
 * reference state. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "program/options/command.h"
#include "program/report/comparison.h"

static const char command[] = "compare";

/* Warn if a breath ends above full inflation. */
static void tell_end_of_breath(const supine_comparison *c, const char *posture, double volume) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  double full = 0.0;
  if (!info->has_rest) {
    return;
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    full += info->reference_volume[lung];
  }
  if (full > 0.0 && supine_input_judge(SUPINE_INPUT_BREATH, volume / full) == SUPINE_INPUT_TOLD) {
    supine_options_say(command,
                       "warning: %s: the breath ends at %.0f mL, above full inflation (%.0f mL): "
                       "choose a smaller breath",
                       posture, volume, full);
  }
}

/* Compute the volume that each lung and each of ten horizontal slabs gains in a breath. The breath
 * begins at the lung volumes in the posture. `xyz` [2][N, 3] is workspace. */
static supine_status find_breath(const supine_comparison *c, float *xyz[2],
                                 supine_compared_posture *posture, supine_error *error) {
  const supine_posture_item *item = posture->item;
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  supine_slab slabs[SUPINE_LUNGS_MAX * SUPINE_COMPARISON_SLABS];
  supine_pose after = posture->pose;
  supine_state state = item->state;
  state.volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, c->breath};
  state.lung_count = 0;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    state.volume.ml += posture->volume[lung];
  }
  supine_error wrong;
  supine_status status = supine_options_pose(c->basis, command, &state, &after, &wrong);
  if (status != SUPINE_OK) {
    return supine_error_wrap(error, &wrong, "%s: ", item->name);
  }
  tell_end_of_breath(c, item->name, state.volume.ml);
  (void)supine_basis_volumes(c->basis, &after, posture->gain);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    posture->gain[lung] -= posture->volume[lung];
  }
  (void)supine_deform(c->basis, &posture->pose, xyz[0]);
  (void)supine_deform(c->basis, &after, xyz[1]);
  status = supine_compare_slabs(c->basis, item->state.gravity, xyz[0], xyz[1],
                                SUPINE_COMPARISON_SLABS, slabs, error);
  if (status == SUPINE_OK) {
    for (size_t i = 0; i < info->lung_count * SUPINE_COMPARISON_SLABS; ++i) {
      posture->slab[i % SUPINE_COMPARISON_SLABS].volume += slabs[i].volume;
      posture->slab[i % SUPINE_COMPARISON_SLABS].gain += slabs[i].gain;
    }
  }
  return status;
}

static supine_status find_posture(const supine_comparison *c, float *distance, float *xyz[2],
                                  supine_compared_posture *posture, supine_error *error) {
  const supine_posture_item *item = posture->item;
  supine_error wrong;
  supine_status status =
      supine_options_pose(c->basis, command, &item->state, &posture->pose, &wrong);
  if (status != SUPINE_OK) {
    return supine_error_wrap(error, &wrong, "%s: ", item->name);
  }
  (void)supine_compare_distances(c->compare, &posture->pose, &c->reference.pose, distance);
  supine_compare_statistics(c->compare, distance, &posture->displacement);
  (void)supine_basis_volumes(c->basis, &posture->pose, posture->volume);
  SUPINE_TRY(supine_options_hilum(c->basis, &item->state, &c->reference.state, false,
                                  &posture->hilum, error));
  if (c->breath > 0.0) {
    status = find_breath(c, xyz, posture, error);
    posture->has_breath = status == SUPINE_OK;
    if (status == SUPINE_ERROR_NUMERICAL && !c->breath_given) { /* more than the lungs hold */
      supine_options_note(command, "without a breath: %s", supine_options_explain(error).text);
      return SUPINE_OK;
    }
  }
  return status;
}

/* Compute the expected error of each posture's displacement, and the targets in each posture. */
static supine_status find_errors(supine_comparison *c, supine_error *error) {
  for (size_t i = 0; i < c->postures.count; ++i) {
    supine_compared_posture *posture = &c->posture[i];
    const supine_state *state = &posture->item->state;
    const supine_pose *const pose[2] = {&c->reference.pose, &posture->pose};
    const supine_state *from = &c->reference.state;
    SUPINE_FREED_BY(supine_posed_errors_free) supine_errors surface = {.moved = {0}};
    SUPINE_FREED_BY(supine_posed_errors_free) supine_errors inside = {.moved = {0}};
    SUPINE_TRY(supine_posed_errors(c->basis, state, from, &surface, error));
    posture->expected_error = surface.position.rms;
    posture->another_error = surface.position.another_rms;
    posture->moved_error = surface.moved.rms;
    c->has_errors = c->has_errors || surface.position.rms > 0.0;
    if (c->inside != NULL) {
      SUPINE_TRY(supine_posed_errors(c->inside, state, from, &inside, error));
      SUPINE_TRY(supine_options_targets_find(c->inside, &c->names, pose, &inside, false,
                                             &posture->targets, error));
    }
  }
  return SUPINE_OK;
}

supine_status supine_report_find(supine_comparison *c, supine_error *error) {
  const size_t n = supine_basis_get_info(c->basis)->vertex_count;
  const size_t count = c->postures.count;
  SUPINE_ARENA arena = {0};
  float *distance = supine_arena_take(&arena, n, sizeof *distance);
  float *xyz[2] = {supine_arena_take(&arena, 3 * n, sizeof(float)),
                   supine_arena_take(&arena, 3 * n, sizeof(float))};
  c->posture = calloc(count, sizeof *c->posture);
  if (arena.failed || c->posture == NULL) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  SUPINE_TRY(supine_options_reference(c->basis, command, &c->from, true, &c->reference, error));
  SUPINE_TRY(supine_compare_create(c->basis, &c->compare, error));
  for (size_t i = 0; i < count; ++i) {
    supine_error wrong = {.message = ""};
    c->posture[i].item = &c->postures.item[i];
    c->posture[i].label = supine_options_posture_label(c->postures.item[i].name);
    const supine_status status = find_posture(c, distance, xyz, &c->posture[i], &wrong);
    SUPINE_REFUSE_IF(status != SUPINE_OK && wrong.message[0] == '\0', error, status, "%s: %s",
                     c->path, supine_status_string(status));
    if (status != SUPINE_OK) {
      return supine_error_wrap(error, &wrong, "%s: ", c->path);
    }
  }
  return find_errors(c, error);
}

void supine_report_free(supine_comparison *c) {
  if (c->posture != NULL) {
    for (size_t i = 0; i < c->postures.count; ++i) {
      free(c->posture[i].targets);
    }
  }
  supine_compare_destroy(c->compare);
  free(c->posture);
}

void supine_report_volume(const supine_comparison *c, char *text, size_t size) {
  char whole[160];
  const supine_volume *volume = &c->volume.state.volume;
  for (size_t i = 0; i < c->postures.count; ++i) {
    const supine_volume *own = &c->postures.item[i].state.volume;
    if (own->kind != volume->kind || own->ml != volume->ml) {
      (void)snprintf(text, size, "of each state");
      return;
    }
  }
  (void)supine_state_describe(&c->volume.state, whole, sizeof whole);
  const char *space = strchr(whole, ' '); /* end of the posture's name */
  (void)snprintf(text, size, "%s", space == NULL ? "as given" : space + 1);
}
