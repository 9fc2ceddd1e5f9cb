/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare scans and landmarks of a person with each other. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <gsl/gsl_statistics.h>
#include <supine/inputs.h>

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
                                .volume = lungs->volume[0] + lungs->volume[1]};
  size->left = lungs->volume[0] / size->volume; /* the left lung is lung 0 */
  return lungs->lung_count == 2;
}

static bool is_told(supine_input_id id, double measured) {
  return supine_input_judge(id, measured) != SUPINE_INPUT_TAKEN;
}

void supine_patient_check_person(const supine_patient_size *first,
                                 const supine_patient_size *second, supine_findings *findings) {
  const bool ordered = first->volume >= second->volume;
  const supine_patient_size *fuller = ordered ? first : second;
  const supine_patient_size *emptier = ordered ? second : first;
  const double width = emptier->width / fuller->width;
  const double depth = emptier->depth / fuller->depth;
  const double left = emptier->left - fuller->left;
  const struct {
    supine_input_id least, most;
    double measured;
    const char *measure, *less, *more;
  } measures[] = {{SUPINE_INPUT_PERSON_WIDTH_LEAST, SUPINE_INPUT_PERSON_WIDTH_MOST, width, "width",
                   "narrower", "wider"},
                  {SUPINE_INPUT_PERSON_DEPTH_LEAST, SUPINE_INPUT_PERSON_DEPTH_MOST, depth, "depth",
                   "flatter from front to back", "deeper from front to back"}};
  for (size_t i = 0; i < sizeof measures / sizeof *measures; ++i) {
    const double measured = measures[i].measured;
    if (is_told(measures[i].least, measured) || is_told(measures[i].most, measured)) {
      supine_findings_warn(
          findings,
          "the lungs are %.0f %% %s in the emptier scan, but one person's keep %.0f to "
          "%.0f %% of their %s: are both scans of one person?",
          100.0 * fabs(measured - 1.0), measured < 1.0 ? measures[i].less : measures[i].more,
          100.0 * supine_input_get(measures[i].least)->told,
          100.0 * supine_input_get(measures[i].most)->told, measures[i].measure);
      return;
    }
  }
  if (is_told(SUPINE_INPUT_PERSON_LEFT_LEAST, left) ||
      is_told(SUPINE_INPUT_PERSON_LEFT_MOST, left)) {
    supine_findings_warn(findings,
                         "the left lung holds %.0f %% of the volume in the fuller "
                         "scan, but %.0f %% in the emptier one: are both scans of one person?",
                         100.0 * fuller->left, 100.0 * emptier->left);
  }
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
