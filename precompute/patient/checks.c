/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare scans and landmarks of a person with each other. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <gsl/gsl_statistics.h>
#include <supine/inputs.h>

#include "precompute/lungs/belong.h"
#include "precompute/patient/checks.h"

#include "base/arena.h"
#include "base/number.h"
#include "base/remedy.h"
#include "base/text.h"
#include "base/vec3.h"

enum { GROUPS = 20, NEIGHBOURS = 8, PAIRS_LEAST = 30, NAMED_MOST = 12 };

/* A coarse surface cuts corners off the lungs, up to about this share of its edge length. */
static const double cut = 0.8;
/* Two postures are different if their unit vectors of gravity are farther apart than this. */
static const double same_posture = 0.05;
static const double growth_least = 0.02; /* smaller changes of ln(volume) are none */
static const double dropped_most = 0.2;  /* largest share of the pairs that are dropped */
/* A pair that differs by less from its neighbours is not dropped, mm. */
static const double difference_least = 20.0;

void supine_patient_size_add(const supine_mesh *mesh, int side, size_t begin, size_t end,
                             supine_patient_size *size) {
  const size_t at = side > 0 ? 0 : 1;
  size->volume[at] = 1e-3 * supine_mesh_spread(mesh, begin, end, size->spread[at]);
}

supine_patient_size supine_patient_size_of(const supine_lungs *lungs) {
  supine_patient_size size = {0};
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    supine_patient_size_add(&lungs->mesh, lungs->side[lung], lungs->lung_begin[lung],
                            lungs->lung_begin[lung + 1], &size);
  }
  return size;
}

/* Advice for lungs that are not those of the scan of a fit. */
static const char check_fit[] = "check that the file of the patient was fitted to this scan";

static bool is_told(supine_input_id id, double measured) {
  return supine_input_judge(id, measured) != SUPINE_INPUT_TAKEN;
}

/* How the measures of one person follow the volume: for each, the line y = slope x through x, the
 * logarithm of emptier / fuller volume of all lungs. Its SD is hypot(floor, sd min(|x|, knee)):
 * people and breaths differ in how much of the first part of a breath lowers the diaphragm or lifts
 * the ribs. Of the spreads of a lung, y is the logarithm of emptier / fuller; of the left lung's
 * share of the volume, their difference. Found by tests/evidence/person.py; the floors, of repeated
 * scans at one volume, and the knee are assumed. */
static const double knee = 0.25;
static const struct {
  const char *measure;
  double slope, sd, floor;
} lines[] = {{"width", 0.212, 0.020, 0.015},
             {"depth", 0.251, 0.138, 0.015},
             {"height", 0.405, 0.261, 0.015},
             {"share", 0.023, 0.040, 0.010}};
enum { SHARE = 3 };

/* The measure that deviates most from its line. */
typedef struct deviation {
  size_t line, side;
  double sds; /* deviation, SD */
  double measured, expected;
} deviation;

static void compare_with_line(size_t line, size_t side, double x, double measured,
                              deviation *worst) {
  const double expected = lines[line].slope * x;
  const double sd = hypot(lines[line].floor, lines[line].sd * fmin(fabs(x), knee));
  const double sds = fabs(measured - expected) / sd;
  if (sds > worst->sds) {
    *worst = (deviation){line, side, sds, measured, expected};
  }
}

static double total(const supine_patient_size *size) {
  return size->volume[0] + size->volume[1];
}

void supine_patient_check_person(const supine_patient_size *first,
                                 const supine_patient_size *second, supine_findings *findings) {
  static const char *const sides[] = {"left", "right"};
  const bool ordered = total(first) >= total(second);
  const supine_patient_size *fuller = ordered ? first : second;
  const supine_patient_size *emptier = ordered ? second : first;
  const double x = log(total(emptier) / total(fuller));
  deviation worst = {.sds = 0.0};
  for (size_t side = 0; side < 2; ++side) {
    if ((fuller->volume[side] > 0.0) != (emptier->volume[side] > 0.0)) {
      return;
    }
    if (fuller->volume[side] > 0.0) {
      for (size_t k = 0; k < 3; ++k) {
        const double ratio = emptier->spread[side][k] / fuller->spread[side][k];
        compare_with_line(k, side, x, log(ratio), &worst);
      }
    }
  }
  const double share = fuller->volume[0] / total(fuller);
  compare_with_line(SHARE, 0, x, emptier->volume[0] / total(emptier) - share, &worst);
  if (!is_told(SUPINE_INPUT_ONE_PERSON, worst.sds)) {
    return;
  }
  const bool is_share = worst.line == SHARE;
  supine_findings_warn(
      findings,
      "from the fuller to the emptier scan, the %s of the %s lung goes to %.0f %%, where %.0f %% "
      "are expected of one person: are both scans of one person, in one unit?",
      is_share ? "share of the volume" : lines[worst.line].measure, sides[worst.side],
      100.0 * (is_share ? share + worst.measured : exp(worst.measured)),
      100.0 * (is_share ? share + worst.expected : exp(worst.expected)));
}

/* Return the mean length of the edges of a surface, mm. */
static double mean_edge(const supine_mesh *mesh) {
  double sum = 0.0;
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    const size_t next = i % 3 == 2 ? i - 2 : i + 1;
    sum += supine_distance(mesh->vertices + 3 * (size_t)mesh->triangles[i],
                           mesh->vertices + 3 * (size_t)mesh->triangles[next]);
  }
  return sum / (double)(3 * mesh->triangle_count);
}

supine_status supine_patient_check_landmarks(const char *state, const supine_mesh *lungs,
                                             size_t count, const double *points,
                                             supine_findings *findings, supine_error *error) {
  SUPINE_FREED_BY(supine_lungs_surface_drop) supine_lungs_surface *tree = NULL;
  supine_lungs_belong found = {.rim = fmax(SUPINE_LUNGS_RIM, cut * mean_edge(lungs))};
  SUPINE_TRY(supine_lungs_surface_create(lungs->vertices, lungs->triangle_count, lungs->triangles,
                                         true, &tree, error));
  supine_lungs_belong_add_points(&found, tree, count, points);
  (void)supine_lungs_belong_judge(&found, SUPINE_INPUT_LANDMARKS_OUTSIDE, "landmarks", state,
                                  findings);
  return SUPINE_OK;
}

/* Return the logarithm of the growth without the pairs of a group (GROUPS: of all pairs).
 * @param some  work space with room for all pairs */
static double growth_without(const supine_patient_pairs *pairs, size_t group,
                             supine_patient_pairs *some) {
  some->count = 0;
  for (size_t i = 0; i < pairs->count; ++i) {
    if (i % GROUPS != group) {
      memcpy(some->from + 3 * some->count, pairs->from + 3 * i, 3 * sizeof(double));
      memcpy(some->to + 3 * some->count, pairs->to + 3 * i, 3 * sizeof(double));
      ++some->count;
    }
  }
  return log(supine_patient_pairs_growth(some));
}

double supine_patient_growth_error(const supine_patient_pairs *pairs) {
  const size_t groups = pairs->count < GROUPS ? pairs->count : GROUPS;
  double growth[GROUPS];
  SUPINE_ARENA arena = {0};
  supine_patient_pairs some = {.from = supine_arena_take(&arena, pairs->count, 3 * sizeof(double)),
                               .to = supine_arena_take(&arena, pairs->count, 3 * sizeof(double))};
  if (arena.failed || groups == 0) {
    return INFINITY;
  }
  for (size_t group = 0; group < groups; ++group) {
    growth[group] = growth_without(pairs, group, &some);
  }
  const double n = (double)groups;
  return sqrt((n - 1.0) / n * gsl_stats_tss(growth, 1, groups));
}

supine_status supine_patient_check_order(const supine_patient_pairs *pairs, double growth,
                                         supine_error *error) {
  const double lungs = log(growth);
  const double landmarks = log(supine_patient_pairs_growth(pairs));
  const bool opposite = fabs(lungs) > growth_least && lungs * landmarks < 0.0;
  const double beyond =
      opposite ? (fabs(landmarks) - growth_least) / supine_patient_growth_error(pairs) : 0.0;
  const supine_input_verdict verdict = supine_input_judge(SUPINE_INPUT_LANDMARKS_ORDER, beyond);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_set("reverse", "if the points are exchanged")};
  SUPINE_REFUSE_ADVISE(
      verdict == SUPINE_INPUT_REFUSED, error, advice, SUPINE_ERROR_FORMAT,
      "from the first to the second points, the landmarks grow to %.0f %% of their volume, but the "
      "lungs to %.0f %%: first and second points, or the states, are exchanged",
      100.0 * exp(landmarks), 100.0 * growth);
  return SUPINE_OK;
}

/* Return the distance, mm, of a pair's displacement from the median of its neighbours'. */
static double difference_of(const supine_patient_pairs *pairs, size_t which) {
  size_t nearest[NEIGHBOURS] = {0};
  double distance[NEIGHBOURS];
  size_t found = 0;
  for (size_t i = 0; i < pairs->count; ++i) {
    const double d = supine_distance(pairs->from + 3 * i, pairs->from + 3 * which);
    size_t at = found;
    if (i == which || (found == NEIGHBOURS && d >= distance[NEIGHBOURS - 1])) {
      continue;
    }
    found += found < NEIGHBOURS;
    at = at < NEIGHBOURS ? at : NEIGHBOURS - 1;
    while (at > 0 && distance[at - 1] > d) {
      distance[at] = distance[at - 1];
      nearest[at] = nearest[at - 1];
      --at;
    }
    distance[at] = d;
    nearest[at] = i;
  }
  double sum = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    double along[NEIGHBOURS];
    for (size_t j = 0; j < found; ++j) {
      along[j] = pairs->to[3 * nearest[j] + k] - pairs->from[3 * nearest[j] + k];
    }
    const double median = gsl_stats_median(along, 1, found);
    sum += pow(pairs->to[3 * which + k] - pairs->from[3 * which + k] - median, 2.0);
  }
  return sqrt(sum);
}

/* Keep the pairs that are not marked, and list the marked ones. */
static void drop_marked(supine_patient_pairs *pairs, const double *difference, double most,
                        char *text, size_t text_size) {
  size_t kept = 0;
  size_t named = 0;
  for (size_t i = 0; i < pairs->count; ++i) {
    if (difference[i] > most) {
      if (named < NAMED_MOST) {
        supine_text_add(text, text_size, "%s%zu", named == 0 ? "" : ", ", i + 1);
      } else if (named == NAMED_MOST) {
        supine_text_add(text, text_size, " and others");
      }
      ++named;
      continue;
    }
    memmove(pairs->from + 3 * kept, pairs->from + 3 * i, 3 * sizeof(double));
    memmove(pairs->to + 3 * kept, pairs->to + 3 * i, 3 * sizeof(double));
    if (pairs->side != NULL) {
      pairs->side[kept] = pairs->side[i];
    }
    ++kept;
  }
  pairs->count = kept;
}

supine_status supine_patient_drop_mismatched(const char *name, supine_patient_pairs *pairs,
                                             supine_findings *findings, supine_error *error) {
  const size_t n = pairs->count;
  size_t dropped = 0;
  char rows[256] = "";
  SUPINE_ARENA arena = {0};
  if (n < PAIRS_LEAST) {
    return SUPINE_OK;
  }
  double *difference = supine_arena_take(&arena, n, 2 * sizeof *difference);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu landmarks", n));
  for (size_t i = 0; i < n; ++i) {
    difference[i] = difference[n + i] = difference_of(pairs, i);
  }
  const double usual = gsl_stats_median(difference + n, 1, n);
  const double most =
      fmax(difference_least, supine_input_get(SUPINE_INPUT_LANDMARKS_MATCH)->told * usual);
  for (size_t i = 0; i < n; ++i) {
    dropped += difference[i] > most;
  }
  if (dropped == 0 || (double)dropped > dropped_most * (double)n) {
    return SUPINE_OK;
  }
  drop_marked(pairs, difference, most, rows, sizeof rows);
  supine_findings_warn(findings,
                       "%s: %zu of %zu pairs of landmarks move otherwise than their neighbours by "
                       "more than %.0f mm, and are left out; check these rows: %s",
                       name, dropped, n, most, rows);
  return SUPINE_OK;
}

void supine_patient_check_volume(const supine_volume *named, double held,
                                 supine_findings *findings) {
  if (named->kind != SUPINE_VOLUME_ABSOLUTE || held <= 0.0 || named->ml <= 0.0) {
    return;
  }
  if (is_told(SUPINE_INPUT_PATIENT_VOLUME, fmax(held / named->ml, named->ml / held))) {
    supine_findings_warn(findings,
                         "a scan holds %.0f mL, but its state says %.0f mL: correct the state, or "
                         "the unit of the scan",
                         held, named->ml);
  }
}

bool supine_patient_tell_rest(double share, const double gravity[3], supine_findings *findings) {
  const supine_resting usual = supine_physics_resting_default();
  const double supine = share * SUPINE_REST_SHARE / supine_physics_resting_total(&usual, gravity);
  const bool told =
      is_told(SUPINE_INPUT_REST_LEAST, supine) || is_told(SUPINE_INPUT_REST_MOST, supine);
  if (told) {
    supine_findings_warn(findings,
                         "the volume at rest is %.0f %% of full inflation by the scans and their "
                         "states, but %.0f %% in healthy people and %.0f %% in COPD, supine",
                         100.0 * share, 100.0 * SUPINE_REST_SHARE, 100.0 * SUPINE_COPD_SHARE);
  }
  return told;
}

/* Warn if lungs have another width, depth or height than the bounding box of the scan that was
 * fitted. Return whether they have. */
static bool tell_box(const supine_lungs *lungs, const double low[3], const double high[3],
                     supine_findings *findings) {
  double farthest = 1.0;
  const char *side = "";
  for (size_t k = 0; k < 3; ++k) {
    static const char *const sides[3] = {"wide", "deep", "high"};
    const double ratio = (lungs->maximum[k] - lungs->minimum[k]) / (high[k] - low[k]);
    if (fmax(ratio, 1.0 / ratio) > fmax(farthest, 1.0 / farthest)) {
      farthest = ratio;
      side = sides[k];
    }
  }
  const bool told = is_told(SUPINE_INPUT_PATIENT_BOX, fmax(farthest, 1.0 / farthest));
  if (told) {
    supine_findings_warn(findings,
                         "the lungs are %.0f %% as %s as those in the scan that was fitted: %s",
                         100.0 * farthest, side, check_fit);
  }
  return told;
}

/* Warn if the landmarks of a fit lie outside lungs that show one of its two states. */
static supine_status check_fitted_landmarks(const supine_patient *patient, size_t state,
                                            const supine_mesh *lungs, supine_findings *findings,
                                            supine_error *error) {
  const supine_patient_frame *frame = &patient->frame;
  const size_t count = patient->landmark_count;
  SUPINE_ARENA arena = {0};
  double *points = supine_arena_take(&arena, count + 1, 3 * sizeof *points);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu landmarks", count));
  for (size_t i = 0; i < count; ++i) {
    double *at = points + 3 * i;
    for (size_t k = 0; k < 3; ++k) {
      at[k] = patient->landmark[i].offset[k] + 0.5 * (frame->minimum[k] + frame->maximum[k]);
    }
    if (state == 1) {
      supine_patient_move_to_emptier(patient, patient->landmark[i].side, at);
    }
  }
  return supine_patient_check_landmarks("scan", lungs, count, points, findings, error);
}

supine_status supine_patient_check_lungs(const supine_patient_record *fitted, size_t state,
                                         const supine_lungs *lungs, supine_findings *findings,
                                         supine_error *error) {
  const supine_patient_frame *frame = &fitted->patient.frame;
  const double *low = state == 0 ? frame->minimum : fitted->emptier[0];
  const double *high = state == 0 ? frame->maximum : fitted->emptier[1];
  const double held = lungs->volume[0] + lungs->volume[1];
  const double volume = fitted->volume[state];
  const bool both = lungs->lung_count == 2 && frame->only_side == 0;
  const bool other_box = both && fitted->from_surface && tell_box(lungs, low, high, findings);
  if (both && !other_box && volume > 0.0 &&
      is_told(SUPINE_INPUT_PATIENT_VOLUME, fmax(held / volume, volume / held))) {
    supine_findings_warn(findings,
                         "the lungs hold %.0f mL, but %.0f mL in the scan that was fitted: %s",
                         held, volume, check_fit);
  }
  return check_fitted_landmarks(&fitted->patient, state, &lungs->mesh, findings, error);
}

void supine_patient_check_state(const supine_state *given, const supine_state *fitted, double held,
                                const supine_resting *resting, supine_findings *findings) {
  const double full = supine_patient_full_volume(fitted, held, resting);
  const double full_given = supine_patient_full_volume(given, held, resting);
  const bool turned = supine_distance(given->gravity, fitted->gravity) > same_posture;
  const double ratio = full > 0.0 && full_given > 0.0 ? full_given / full : 1.0;
  const bool other = is_told(SUPINE_INPUT_PATIENT_VOLUME, fmax(ratio, 1.0 / ratio));
  char names[2][160];
  char volumes[128] = "";
  (void)supine_state_print(given, names[0], sizeof names[0]);
  (void)supine_state_print(fitted, names[1], sizeof names[1]);
  if (other) {
    supine_text_add(volumes, sizeof volumes,
                    ", by which full inflation is %.0f mL instead of %.0f mL", full, full_given);
  }
  if (turned || other) {
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_omit("scanned")};
    supine_findings_warn(findings,
                         "the state of the scan is given as %s, but the patient's law was fitted "
                         "to it as %s%s: if the fit is wrong, fit again with the right states",
                         names[0], names[1], volumes);
    supine_findings_advise(findings, advice);
  }
}
