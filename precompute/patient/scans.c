/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Order two scans by volume, complete their states, and fit a displacement law to them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/inputs.h>

#include "precompute/patient/checks.h"
#include "precompute/patient/matching.h"
#include "precompute/patient/scans.h"

#include "base/arena.h"
#include "base/number.h"
#include "base/remedy.h"
#include "base/text.h"
#include "precompute/lungs/surface.h"

void supine_patient_scans_free(supine_patient_scans *scans) {
  supine_lungs_free(&scans->lungs[0]);
  supine_lungs_free(&scans->lungs[1]);
  supine_patient_pairs_free(&scans->pairs);
}

static double volume_of(const supine_lungs *lungs) {
  return lungs->volume[0] + lungs->volume[1];
}

/* Assign each landmark to the lung whose surface is nearest to it in the first scan. */
static supine_status find_sides(const supine_lungs *lungs, supine_patient_pairs *pairs,
                                supine_error *error) {
  SUPINE_FREED_BY(supine_lungs_surface_drop) supine_lungs_surface *tree = NULL;
  pairs->side = malloc(pairs->count * sizeof *pairs->side);
  if (pairs->side == NULL) {
    return supine_error_memory(error, "%zu landmarks", pairs->count);
  }
  SUPINE_TRY(supine_lungs_surface_create(lungs->mesh.vertices, lungs->mesh.triangle_count,
                                         lungs->mesh.triangles, false, &tree, error));
  for (size_t i = 0; i < pairs->count; ++i) {
    const supine_inside_place place = supine_lungs_surface_nearest(tree, pairs->from + 3 * i, NULL);
    const size_t lung =
        lungs->lung_count == 2 && place.triangle >= lungs->triangle_begin[1] ? 1 : 0;
    pairs->side[i] = lungs->side[lung];
  }
  return SUPINE_OK;
}

/* Return 1 if the states say that the second is fuller, -1 if the first is, else 0. */
static int named_order(const supine_state state[2]) {
  const supine_volume *a = &state[0].volume;
  const supine_volume *b = &state[1].volume;
  const bool turned = memcmp(state[0].gravity, state[1].gravity, sizeof state[0].gravity) != 0;
  double more = 0.0;
  if (a->kind != b->kind) {
    if (a->kind == SUPINE_VOLUME_REST && b->kind == SUPINE_VOLUME_FULL) {
      more = 1.0;
    } else if (a->kind == SUPINE_VOLUME_FULL && b->kind == SUPINE_VOLUME_REST) {
      more = -1.0;
    }
  } else if (a->kind != SUPINE_VOLUME_DEFAULT && !(a->kind == SUPINE_VOLUME_REST && turned)) {
    more = b->ml - a->ml;
  }
  return (more > 0.0) - (more < 0.0);
}

/* Set the volume of scan k (0 or 1), if it was not given, to that of its surface. If the volume of
 * the other scan is relative to full inflation, or to rest in the same posture, make this one
 * relative too; otherwise absolute. */
static void complete_state(supine_patient_record *record, size_t k) {
  supine_volume *of = &record->state[k].volume;
  const supine_state *other = &record->state[1 - k];
  const bool same = memcmp(record->state[k].gravity, other->gravity, sizeof other->gravity) == 0;
  if (of->kind == SUPINE_VOLUME_DEFAULT && record->volume[k] > 0.0) {
    const bool relative =
        record->volume[1 - k] > 0.0 && (other->volume.kind == SUPINE_VOLUME_FULL ||
                                        (other->volume.kind == SUPINE_VOLUME_REST && same));
    *of = relative ? (supine_volume){other->volume.kind,
                                     other->volume.ml + record->volume[k] - record->volume[1 - k]}
                   : (supine_volume){SUPINE_VOLUME_ABSOLUTE, record->volume[k]};
  }
}

/* If only the volumes of the scans are known, count the emptier scan as rest. Count the fuller scan
 * as full inflation, unless the other holds more of it than lungs at rest do. */
static void name_volumes(supine_patient_scans *scans, supine_patient_record *record) {
  static const double rest_most = 0.81; /* largest share at rest of ten patients with COPD */
  const double *v = record->volume;
  const bool breath = v[1] > rest_most * v[0];
  if (record->state[0].volume.kind == SUPINE_VOLUME_ABSOLUTE &&
      record->state[1].volume.kind == SUPINE_VOLUME_ABSOLUTE) {
    record->state[1].volume = (supine_volume){SUPINE_VOLUME_REST, 0.0};
    record->state[0].volume = breath ? (supine_volume){SUPINE_VOLUME_REST, v[0] - v[1]}
                                     : (supine_volume){SUPINE_VOLUME_FULL, 0.0};
    supine_findings_note(&scans->findings,
                         "the scan of %.0f mL counts as rest, that of %.0f mL as %s", v[1], v[0],
                         breath ? "a breath above it" : "full inflation");
  }
}

/* Warn if the scans and their states give a volume at rest that people hardly have. */
static void warn_of_rest(supine_patient_scans *scans, const supine_patient_record *record) {
  const supine_resting usual = supine_physics_resting_default();
  for (size_t k = 0; k < 2; ++k) {
    const double share = supine_patient_rest_share(record, k, &usual);
    if (share != 0.0 &&
        supine_patient_tell_rest(share, record->state[k].gravity, &scans->findings)) {
      const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
          supine_remedy_change("rest", "if it is not the state of that scan")};
      supine_findings_advise(&scans->findings, advice);
    }
  }
}

/* Warn if two scans, of which one may have no surface, hardly show one person in one posture. */
static void warn_of_two_people(const supine_lungs *first, const supine_state *first_state,
                               const supine_lungs *second, const supine_state *second_state,
                               supine_findings *findings) {
  const bool turned =
      memcmp(first_state->gravity, second_state->gravity, sizeof first_state->gravity) != 0;
  if (first->mesh.vertex_count > 0 && second->mesh.vertex_count > 0 && !turned) {
    const supine_patient_size size[2] = {supine_patient_size_of(first),
                                         supine_patient_size_of(second)};
    supine_patient_check_person(&size[0], &size[1], findings);
  }
}

static void set_states(supine_patient_scans *scans, supine_patient_record *record) {
  const supine_lungs *emptier = &scans->lungs[1];
  const supine_patient_frame frame =
      supine_patient_frame_of_points(scans->pairs.count, scans->pairs.to, NULL);
  for (size_t k = 0; k < 2; ++k) {
    const supine_volume *volume = &record->state[k].volume;
    const supine_lungs *lungs = &scans->lungs[k];
    record->volume[k] = volume_of(lungs);
    supine_patient_check_volume(volume, record->volume[k], &scans->findings);
    for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
      record->measured_lung[k][lungs->side[lung] > 0 ? 0 : 1] = lungs->volume[lung];
    }
    if (record->volume[k] == 0.0 && volume->kind == SUPINE_VOLUME_ABSOLUTE) {
      record->volume[k] = volume->ml;
    }
  }
  complete_state(record, 0);
  complete_state(record, 1);
  name_volumes(scans, record);
  warn_of_rest(scans, record);
  warn_of_two_people(&scans->lungs[0], &record->state[0], emptier, &record->state[1],
                     &scans->findings);
  memcpy(record->emptier[0], record->from_surface ? emptier->minimum : frame.minimum,
         sizeof record->emptier[0]);
  memcpy(record->emptier[1], record->from_surface ? emptier->maximum : frame.maximum,
         sizeof record->emptier[1]);
}

/* Thin landmarks to the number that a fit takes, and say so. A registration gives thousands. */
static supine_status thin(supine_patient_scans *scans, bool from_surface, supine_error *error) {
  const size_t most = SUPINE_PATIENT_CENTRES_MAX - (from_surface ? SUPINE_PATIENT_VERTICES_MAX : 0);
  const size_t given = scans->pairs.count;
  if (given > most) {
    SUPINE_TRY(supine_patient_pairs_thin(&scans->pairs, most, error));
    supine_findings_note(&scans->findings,
                         "of %zu pairs of landmarks, the %zu that are spread most evenly over "
                         "the lungs are fitted",
                         given, most);
  }
  return SUPINE_OK;
}

static void exchange(supine_patient_scans *scans, supine_state state[2]) {
  const supine_lungs lungs = scans->lungs[0];
  const supine_state first = state[0];
  double *from = scans->pairs.from;
  scans->lungs[0] = scans->lungs[1];
  scans->lungs[1] = lungs;
  state[0] = state[1];
  state[1] = first;
  scans->pairs.from = scans->pairs.to;
  scans->pairs.to = from;
  scans->reordered = true;
}

supine_status supine_patient_scans_order(supine_patient_scans *scans, supine_patient_record *record,
                                         supine_error *error) {
  /* The measured volumes contradict the states only if they differ by more than this fraction. */
  static const double volume_error = 0.02;
  const double volume[2] = {volume_of(&scans->lungs[0]), volume_of(&scans->lungs[1])};
  const int named = named_order(record->state);
  record->from_surface = volume[0] > 0.0 && volume[1] > 0.0;
  double growth = 1.0; /* volume of the second scan / that of the first */
  double doubt = volume_error;
  if (record->from_surface) {
    growth = volume[1] / volume[0];
  } else if (scans->pairs.count > 0) {
    growth = supine_patient_pairs_growth(&scans->pairs);
    doubt += supine_input_get(SUPINE_INPUT_LANDMARKS_ORDER)->refused *
             supine_patient_growth_error(&scans->pairs);
  }
  const supine_remedy reverse[SUPINE_REMEDIES_MAX] = {
      supine_remedy_set("reverse", "if the landmarks begin in the fuller scan")};
  SUPINE_REFUSE_ADVISE((named > 0 && growth < 1.0 - doubt) || (named < 0 && growth > 1.0 + doubt),
                       error, reverse, SUPINE_ERROR_FORMAT,
                       "the scan given as the fuller one has only %.0f %% of the volume of the "
                       "other scan: exchange the states",
                       100.0 * (named > 0 ? growth : 1.0 / growth));
  if (record->from_surface && scans->pairs.count > 0) {
    SUPINE_TRY(supine_patient_check_order(&scans->pairs, growth, error));
  }
  SUPINE_TRY(thin(scans, record->from_surface, error));
  if (volume[0] > 0.0 && scans->pairs.count > 0) {
    SUPINE_TRY(find_sides(&scans->lungs[0], &scans->pairs, error));
    SUPINE_TRY(supine_patient_check_landmarks("first scan", &scans->lungs[0].mesh,
                                              scans->pairs.count, scans->pairs.from,
                                              &scans->findings, error));
  }
  if (volume[1] > 0.0 && scans->pairs.count > 0) {
    SUPINE_TRY(supine_patient_check_landmarks("second scan", &scans->lungs[1].mesh,
                                              scans->pairs.count, scans->pairs.to, &scans->findings,
                                              error));
  }
  if (named > 0 || (named == 0 && growth > 1.0)) {
    exchange(scans, record->state);
  }
  set_states(scans, record);
  const bool volumes_known = record->volume[0] > 0.0 && record->volume[1] > 0.0;
  const supine_remedy volumes[SUPINE_REMEDIES_MAX] = {
      supine_remedy_such_as("rest", "2600mL", "with the other volume")};
  SUPINE_REFUSE_ADVISE(!record->from_surface && !volumes_known, error, volumes,
                       SUPINE_ERROR_ARGUMENT,
                       "landmarks do not show the volume of the lungs, which decides what rest and "
                       "full inflation are: give both surfaces, or both volumes of gas and tissue");
  return SUPINE_OK;
}

static supine_status fit_landmarks(const supine_patient_scans *scans,
                                   const supine_patient_fit_options *options,
                                   supine_patient_record *record, supine_error *error) {
  const supine_patient_pairs *pairs = &scans->pairs;
  SUPINE_ARENA arena = {0};
  supine_patient_row *rows = supine_arena_take(&arena, pairs->count, 3 * sizeof *rows);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu landmarks", pairs->count));
  record->patient.frame = supine_patient_frame_of_points(pairs->count, pairs->from, scans->midline);
  supine_patient_rows_of_pairs(&record->patient.frame, pairs, rows);
  SUPINE_TRY(
      supine_patient_fit(options, rows, 0, pairs->count, &record->patient, &record->report, error));
  return supine_patient_applied_find_landmarks(rows, pairs->count, &record->patient,
                                               options->gravity, &record->applied, error);
}

/* Warn of surfaces that are hardly apart, as those of one scan that is given twice. */
static void warn_of_one_scan(supine_patient_scans *scans, double apart) {
  if (supine_input_judge(SUPINE_INPUT_SCANS_APART, apart) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(&scans->findings,
                         "the surfaces of the two scans are only %s mm RMS apart, as two surfaces "
                         "of one scan are: check that they are scans of different states",
                         supine_text_distance(apart).text);
  }
}

supine_status supine_patient_scans_fit(supine_patient_scans *scans,
                                       const supine_patient_fit_options *options,
                                       bool expandability, supine_patient_record *record,
                                       supine_error *error) {
  const supine_model deep = supine_physics_model(SUPINE_LAW_DEEP);
  const double *gravity = record->state[1].gravity;
  supine_patient_fit_options wanted = *options;
  double gains[2][3];
  supine_patient_path(record, gains);
  for (size_t k = 0; k < 3; ++k) {
    wanted.gravity[k] = gravity[k];
    wanted.path_span[k] = gains[1][k] - gains[0][k];
  }
  if (record->from_surface) {
    SUPINE_TRY(supine_patient_fit_surface(&scans->lungs[0], &scans->lungs[1].mesh, &scans->pairs,
                                          &wanted, expandability, record, error));
    warn_of_one_scan(scans, record->surface.before);
  } else {
    SUPINE_TRY(fit_landmarks(scans, &wanted, record, error));
  }
  record->force = supine_patient_force(&record->patient.power, deep.force.gain, gravity);
  return SUPINE_OK;
}

/* Append a further state to the record, without a result. */
static supine_patient_further *append(supine_patient_record *record, const supine_state *state) {
  supine_patient_further *further = &record->further[record->further_count++];
  *further = (supine_patient_further){.state = *state};
  return further;
}

supine_status supine_patient_scans_fit_further_landmarks(
    const supine_patient_scans *scans, const supine_state *state, bool scans_moved,
    supine_patient_pairs *pairs, supine_patient_record *record, supine_error *error) {
  supine_patient_further *further = append(record, state);
  if (scans->reordered) {
    supine_patient_points_to_fuller(&record->patient, pairs->count, pairs->from);
  }
  return supine_patient_gain_fit_landmarks(record, pairs, scans_moved, further, error);
}

/* Warn if a further state that is named from rest does not fit the volume of its scan. */
static void check_rest_of_further(const supine_patient_record *record, const supine_state *named,
                                  double held, supine_findings *findings) {
  for (size_t k = 0; k < 2; ++k) {
    const supine_state *shown = &record->state[k];
    if (named->volume.kind == SUPINE_VOLUME_REST && named->lung_count == 0 &&
        shown->volume.kind == SUPINE_VOLUME_FULL && record->volume[k] > 0.0) {
      const double full = (record->volume[k] - shown->volume.ml) /
                          supine_physics_resting_full_share(shown->gravity);
      (void)supine_patient_tell_rest((held - named->volume.ml) / full, named->gravity, findings);
    }
  }
}

supine_status supine_patient_scans_fit_further_surface(supine_patient_scans *scans,
                                                       const supine_state *state, bool scans_moved,
                                                       const supine_lungs *scan,
                                                       supine_patient_record *record,
                                                       supine_error *error) {
  supine_lungs *from = &scans->lungs[0];
  supine_patient_further *further = append(record, state);
  const size_t other = from->mesh.vertex_count > 0 ? 0 : 1;
  warn_of_two_people(&scans->lungs[other], &record->state[other], scan, state, &scans->findings);
  check_rest_of_further(record, state, volume_of(scan), &scans->findings);
  if (from->mesh.vertex_count == 0) {
    /* The fuller scan has no surface: move that of the emptier one to the fuller state. */
    *from = scans->lungs[1];
    scans->lungs[1] = (supine_lungs){0};
    supine_patient_points_to_fuller(&record->patient, from->mesh.vertex_count, from->mesh.vertices);
    supine_lungs_measure(from);
  }
  return supine_patient_gain_fit_surface(record, from, &scan->mesh, scans_moved, further, error);
}
