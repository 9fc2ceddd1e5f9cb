/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare scans and landmarks of a person with each other. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <gsl/gsl_statistics.h>
#include <supine/inputs.h>

#include "precompute/lungs/surface.h"
#include "precompute/patient/checks.h"

#include "base/arena.h"
#include "base/number.h"
#include "base/text.h"
#include "base/vec3.h"

enum { GROUPS = 20, NEIGHBOURS = 8, PAIRS_LEAST = 30, NAMED_MOST = 12 };

static const double growth_least = 0.02; /* smaller changes of ln(volume) are none */
static const double dropped_most = 0.2;  /* largest share of the pairs that are dropped */
/* A pair that differs by less from its neighbours is not dropped, mm. */
static const double difference_least = 20.0;

bool supine_patient_size_of(const supine_lungs *lungs, supine_patient_size *size) {
  *size = (supine_patient_size){.width = lungs->maximum[0] - lungs->minimum[0],
                                .depth = lungs->maximum[1] - lungs->minimum[1],
                                .height = lungs->maximum[2] - lungs->minimum[2],
                                .volume = lungs->volume[0] + lungs->volume[1]};
  size->left = lungs->volume[0] / size->volume; /* the left lung is lung 0 */
  return lungs->lung_count == 2;
}

static bool is_told(supine_input_id id, double measured) {
  return supine_input_judge(id, measured) != SUPINE_INPUT_TAKEN;
}

/* How the measures of one person follow the volume: for each, the line y = slope x through x, the
 * logarithm of emptier / fuller volume. Its SD is that of people's slopes, times x, and `floor`, of
 * repeated scans at one volume and of the surfaces' edges. Sizes are logarithms of emptier / fuller
 * scan; the share of the left lung is a difference. Found by tests/evidence/person.py; the floors
 * are assumed. */
static const struct {
  const char *measure;
  double slope, spread, floor;
} lines[] = {{"width", 0.159, 0.023, 0.015},
             {"depth", 0.212, 0.054, 0.015},
             {"height", 0.280, 0.114, 0.015},
             {"share of the left lung", 0.028, 0.017, 0.011}};

void supine_patient_check_person(const supine_patient_size *first,
                                 const supine_patient_size *second, supine_findings *findings) {
  const bool ordered = first->volume >= second->volume;
  const supine_patient_size *fuller = ordered ? first : second;
  const supine_patient_size *emptier = ordered ? second : first;
  const double x = log(emptier->volume / fuller->volume);
  const double measured[] = {log(emptier->width / fuller->width),
                             log(emptier->depth / fuller->depth),
                             log(emptier->height / fuller->height), emptier->left - fuller->left};
  size_t worst = 0;
  double most = 0.0;
  for (size_t i = 0; i < sizeof lines / sizeof *lines; ++i) {
    const double sd = hypot(lines[i].floor, lines[i].spread * x);
    const double deviation = fabs(measured[i] - lines[i].slope * x) / sd;
    worst = deviation > most ? i : worst;
    most = fmax(most, deviation);
  }
  if (is_told(SUPINE_INPUT_ONE_PERSON, most)) {
    const double expected = lines[worst].slope * x;
    const bool share = worst == 3;
    supine_findings_warn(
        findings,
        "from the fuller to the emptier scan, the %s of the lungs goes to %.0f %%, where %.0f %% "
        "are expected of one person: are both scans of one person, in one unit?",
        lines[worst].measure, 100.0 * (share ? emptier->left : exp(measured[worst])),
        100.0 * (share ? fuller->left + expected : exp(expected)));
  }
}

supine_status supine_patient_check_landmarks(const char *state, const supine_mesh *lungs,
                                             size_t count, const double *points,
                                             supine_findings *findings, supine_error *error) {
  static const double far = 5.0; /* mm; landmarks and surfaces differ by less */
  SUPINE_FREED_BY(supine_lungs_surface_drop) supine_lungs_surface *tree = NULL;
  size_t outside = 0;
  double farthest = 0.0;
  SUPINE_TRY(supine_lungs_surface_create(lungs->vertices, lungs->triangle_count, lungs->triangles,
                                         true, &tree, error));
  for (size_t i = 0; i < count; ++i) {
    const double depth = supine_lungs_surface_find(tree, points + 3 * i, NULL).depth;
    outside += depth < -far;
    farthest = fmax(farthest, -depth);
  }
  const double share = count > 0 ? (double)outside / (double)count : 0.0;
  if (is_told(SUPINE_INPUT_LANDMARKS_OUTSIDE, share)) {
    supine_findings_warn(findings,
                         "%zu of %zu landmarks lie outside the lungs of the %s, by up to %.0f mm: "
                         "check that they are this person's, and their axes",
                         outside, count, state, farthest);
  }
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
  SUPINE_REFUSE_IF(
      verdict == SUPINE_INPUT_REFUSED, error, SUPINE_ERROR_FORMAT,
      "from the first to the second points, the landmarks grow to %.0f %% of their volume, but the "
      "lungs to %.0f %%: first and second points, or the states, are exchanged; reverse the "
      "landmarks",
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

void supine_patient_check_size(const supine_lungs *lungs, const double low[3], const double high[3],
                               double volume, supine_findings *findings) {
  const double held = lungs->volume[0] + lungs->volume[1];
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
  static const char advice[] = "check that the file of the patient was fitted to this scan";
  if (is_told(SUPINE_INPUT_PATIENT_BOX, fmax(farthest, 1.0 / farthest))) {
    supine_findings_warn(findings,
                         "the lungs are %.0f %% as %s as those in the scan that was fitted: %s",
                         100.0 * farthest, side, advice);
  } else if (volume > 0.0 &&
             is_told(SUPINE_INPUT_PATIENT_VOLUME, fmax(held / volume, volume / held))) {
    supine_findings_warn(findings,
                         "the lungs hold %.0f mL, but %.0f mL in the scan that was fitted: %s",
                         held, volume, advice);
  }
}
