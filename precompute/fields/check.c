/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Question another simulator's fields: the directions of gravity, the sizes of the displacements,
 * and the errors of the fit in runs that are left out.
 *
 * Two plain measures judge the directions, because errors of runs that are left out are silent
 * about directions where there is no run.
 *
 *   gap        angle between the direction farthest from all runs and the nearest run. It says how
 *              far a fit must reach, whatever its band: next to an empty half, fits erred 8
 *              times as much as they stated.
 *   condition  condition number of the harmonics to degree 1 in the directions. It says whether
 *              the runs determine any dependence on gravity at all. A circle of directions has the
 *              same gap as a half of the sphere, but leaves the motion across it unknown: its
 *              condition number is infinite, that of the half 3.7. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/text.h"
#include "base/vec3.h"
#include "precompute/fields/check.h"
#include "precompute/fields/nodes.h"
#include "precompute/fields/volumes.h"

/* Directions in which the gap is looked for; they are 3 degrees apart. */
enum { PROBES = 5000 };

static const double degrees_per_radian = 57.29577951308232;

/* An error relative to the displacement that is rounding of the stored numbers: smaller ones are
 * not compared. */
static const double rounding = 1e-4;

/* Direction of gravity in supine posture, LPS. */
static const double supine_gravity[3] = {0.0, 1.0, 0.0};

typedef struct checking {
  const char *name;
  const supine_fields *fields;
  const supine_lungs *lungs;
  supine_findings *findings;
  supine_error *error;
  size_t *direction; /* [runs] number of the direction of each run */
  double *distinct;  /* [directions, 3] */
  size_t directions; /* number of different directions */
  double *size;      /* [runs] RMS displacement, mm */
} checking;

static double angle_between(const double a[3], const double b[3]) {
  return 2.0 * asin(fmin(0.5 * supine_distance(a, b), 1.0)) * degrees_per_radian;
}

/* Find the widest gap between directions: the angle from the direction farthest from all to the
 * nearest of them, degrees.
 * @param middle  written: the direction farthest from all */
static double find_gap(const checking *c, double middle[3]) {
  double widest = -1.0;
  for (size_t p = 0; p < PROBES; ++p) {
    double probe[3];
    double nearest = INFINITY;
    supine_spiral((double)p, (double)PROBES, 0.0, probe);
    for (size_t d = 0; d < c->directions; ++d) {
      nearest = fmin(nearest, angle_between(probe, c->distinct + 3 * d));
    }
    if (nearest > widest) {
      widest = nearest;
      for (size_t k = 0; k < 3; ++k) {
        middle[k] = probe[k];
      }
    }
  }
  return widest;
}

/* Compute the condition number of the harmonics to degree 1 in the directions: infinite if there
 * are fewer directions than these four harmonics. */
static supine_status find_condition(const checking *c, double *condition) {
  SUPINE_ARENA arena = {0};
  supine_regression fitted;
  const supine_runs runs = {.count = c->directions, .part_count = 1, .gravity = c->distinct};
  *condition = INFINITY;
  if (c->directions >= 4) {
    SUPINE_TRY(supine_fields_regression_create(&runs, 1, 0, &arena, &fitted));
    *condition = fitted.condition;
  }
  return SUPINE_OK;
}

static supine_status check_directions(const checking *c) {
  double middle[3] = {0.0, 0.0, 0.0};
  double condition = INFINITY;
  SUPINE_TRY(find_condition(c, &condition));
  const double gap = find_gap(c, middle);
  const supine_input_verdict verdict =
      supine_input_judge(SUPINE_INPUT_FIELDS_DIRECTIONS, condition);
  SUPINE_REFUSE_IF(
      verdict == SUPINE_INPUT_REFUSED, c->error, SUPINE_ERROR_FORMAT,
      "%s: the directions of gravity do not cover the sphere: there is none within %.0f degrees of "
      "%.2f,%.2f,%.2f (LPS), and they do not determine how gravity displaces the lungs in other "
      "directions. Simulate evenly spread directions, at least 8",
      c->name, gap, middle[0], middle[1], middle[2]);
  if (supine_input_judge(SUPINE_INPUT_FIELDS_GAP, gap) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(
        c->findings,
        "%s: the directions of gravity leave a gap: there is none within %.0f degrees of "
        "%.2f,%.2f,%.2f (LPS). There, errors are several times those elsewhere: simulate "
        "directions in the gap",
        c->name, gap, middle[0], middle[1], middle[2]);
  }
  return SUPINE_OK;
}

/* Compute the sum of squared distances of points from their mean. */
static double spread_of(const double *points, size_t count) {
  double mean[3] = {0.0, 0.0, 0.0};
  double sum = 0.0;
  for (size_t i = 0; i < 3 * count; ++i) {
    mean[i % 3] += points[i] / (double)count;
  }
  for (size_t i = 0; i < count; ++i) {
    const double apart = supine_distance(points + 3 * i, mean);
    sum += apart * apart;
  }
  return sum;
}

/* Refuse displacements that are spread as widely as the vertices. Positions are, in any frame. */
static supine_status check_positions(const checking *c) {
  const size_t n = c->fields->vertex_count;
  double spread = 0.0;
  for (size_t run = 0; run < c->fields->run_count; ++run) {
    spread += spread_of(c->fields->displacement + 3 * n * run, n);
  }
  const double of_vertices = (double)c->fields->run_count * spread_of(c->lungs->mesh.vertices, n);
  const supine_input_verdict verdict =
      supine_input_judge(SUPINE_INPUT_FIELDS_POSITIONS, sqrt(spread / of_vertices));
  SUPINE_REFUSE_IF(verdict == SUPINE_INPUT_REFUSED, c->error, SUPINE_ERROR_FORMAT,
                   "%s: the displacements differ between vertices by %.0f %% of what the positions "
                   "do: they seem to be positions, or to have another unit. Subtract the points "
                   "from displaced positions, and use one unit",
                   c->name, 100.0 * sqrt(spread / of_vertices));
  return SUPINE_OK;
}

/* Measure the RMS displacement of each run and of all. */
static void measure_sizes(const checking *c, supine_fields_motion *motion) {
  const size_t n = c->fields->vertex_count;
  double sum = 0.0;
  for (size_t run = 0; run < c->fields->run_count; ++run) {
    double square = 0.0;
    for (size_t i = 0; i < n; ++i) {
      const double *u = c->fields->displacement + 3 * (n * run + i);
      square += supine_dot(u, u);
    }
    c->size[run] = sqrt(square / (double)n);
    sum += square / (double)n;
  }
  motion->rms_mm = sqrt(sum / (double)c->fields->run_count);
}

/* Measure the mean displacement along gravity in the runs whose direction is nearest to supine. */
static void measure_along(const checking *c, supine_fields_motion *motion) {
  const supine_fields *fields = c->fields;
  const size_t n = fields->vertex_count;
  size_t nearest = 0;
  size_t count = 0;
  double sum = 0.0;
  for (size_t d = 1; d < c->directions; ++d) {
    if (supine_dot(c->distinct + 3 * d, supine_gravity) >
        supine_dot(c->distinct + 3 * nearest, supine_gravity)) {
      nearest = d;
    }
  }
  for (size_t k = 0; k < 3; ++k) {
    motion->nearest[k] = c->distinct[3 * nearest + k];
  }
  for (size_t run = 0; run < fields->run_count; ++run) {
    if (c->direction[run] != nearest) {
      continue;
    }
    for (size_t i = 0; i < n; ++i) {
      sum += supine_dot(fields->displacement + 3 * (n * run + i), motion->nearest);
    }
    count += n;
  }
  motion->along_mm = sum / (double)count;
}

/* Tell of a run that is much larger than all others. A run that is smaller is right: it may be that
 * of the reference posture. */
static void check_sizes(const checking *c) {
  size_t largest = 0;
  double second = 0.0;
  for (size_t run = 1; run < c->fields->run_count; ++run) {
    if (c->size[run] > c->size[largest]) {
      second = c->size[largest];
      largest = run;
    } else {
      second = fmax(second, c->size[run]);
    }
  }
  if (c->size[largest] > 0.0 &&
      supine_input_judge(SUPINE_INPUT_FIELDS_RUN_SIZE, c->size[largest] / second) !=
          SUPINE_INPUT_TAKEN) {
    supine_findings_warn(c->findings,
                         "%s: row %zu: the displacement, %s mm RMS, is much larger than "
                         "in all other rows, at most %s mm: check this run and its unit",
                         c->name, largest, supine_text_distance(c->size[largest]).text,
                         supine_text_distance(second).text);
  }
}

/* Tell of runs whose displacements are exactly those of an earlier run. */
static void check_copies(const checking *c) {
  const size_t row = 3 * c->fields->vertex_count;
  for (size_t run = 1; run < c->fields->run_count; ++run) {
    const double *u = c->fields->displacement + row * run;
    size_t other = 0;
    while (other < run &&
           (c->size[run] != c->size[other] ||
            memcmp(u, c->fields->displacement + row * other, row * sizeof *u) != 0)) {
      ++other;
    }
    if (other < run &&
        supine_input_judge(SUPINE_INPUT_FIELDS_COPY, c->size[run] > 0.0) != SUPINE_INPUT_TAKEN) {
      supine_findings_warn(c->findings,
                           "%s: rows %zu and %zu have exactly the same displacements: one "
                           "of these runs may be a copy. Check both, or leave one out",
                           c->name, other, run);
    }
  }
}

/* Tell of a vertex that moves unlike its neighbours. */
static supine_status check_nodes(const checking *c, const supine_fields_motion *motion) {
  supine_stray found;
  SUPINE_TRY(supine_fields_find_stray(c->fields, c->lungs, motion->rms_mm, &found));
  if (supine_input_judge(SUPINE_INPUT_FIELDS_NODE, found.ratio) != SUPINE_INPUT_TAKEN) {
    const double *v = c->lungs->mesh.vertices + 3 * found.vertex;
    supine_findings_warn(c->findings,
                         "%s: row %zu: the point at %.1f,%.1f,%.1f mm (LPS) is displaced "
                         "by %s mm more than its neighbours: check this node of the simulation",
                         c->name, found.run, v[0], v[1], v[2],
                         supine_text_distance(found.apart_mm).text);
  }
  return SUPINE_OK;
}

static supine_status check_all(checking *c, supine_fields_motion *motion) {
  measure_sizes(c, motion);
  measure_along(c, motion);
  SUPINE_TRY(check_directions(c));
  SUPINE_TRY(check_positions(c));
  check_sizes(c);
  check_copies(c);
  return check_nodes(c, motion);
}

supine_status supine_fields_check(const char *name, const supine_fields *fields,
                                  const supine_lungs *lungs, supine_findings *findings,
                                  supine_fields_motion *motion, supine_error *error) {
  const size_t m = fields->run_count;
  SUPINE_ARENA arena = {0};
  checking c = {
      .name = name, .fields = fields, .lungs = lungs, .findings = findings, .error = error};
  c.direction = supine_arena_take(&arena, m, sizeof *c.direction);
  c.distinct = supine_arena_take(&arena, 3 * m, sizeof *c.distinct);
  c.size = supine_arena_take(&arena, m, sizeof *c.size);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu fields", m));
  c.directions = supine_fields_number_directions(fields, c.direction);
  for (size_t i = 0; i < 3 * m; ++i) {
    c.distinct[3 * c.direction[i / 3] + i % 3] = fields->directions[i];
  }
  return check_all(&c, motion);
}

/* Return the error of the fit in runs that are left out, as a part of what depends on gravity: of
 * the displacement, or of the error without harmonics of gravity if that is less. Fields in which
 * the part common to all directions is large have a small error beside the displacement, even if
 * the rows of their directions are in the wrong order. */
static double left_out(const supine_fit_report *report) {
  double least = report->error[report->order][report->band];
  double without = 1.0;
  for (size_t order = 0; order <= SUPINE_FIT_ORDER_MAX; ++order) {
    const double *error = report->error[order];
    for (size_t band = 0; band <= SUPINE_FIT_BAND_MAX; ++band) {
      least = error[band] > 0.0 ? fmin(least, error[band]) : least;
    }
    without = error[0] > 0.0 ? fmin(without, error[0]) : without;
  }
  return without > rounding ? least / without : 0.0;
}

/* Tell of runs that the others do not predict. */
static void check_runs(const char *name, const supine_fit_report *report,
                       supine_findings *findings) {
  if (supine_input_judge(SUPINE_INPUT_FIELDS_ZERO, report->zero.ratio) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(findings,
                         "%s: row %zu: all displacements are 0, but the other rows predict "
                         "%.0f %% of the RMS displacement: check whether this run has ended",
                         name, report->zero.run, 100.0 * report->zero.part);
  }
  for (size_t i = 0; i < report->suspect_count; ++i) {
    const supine_fit_suspect *suspect = &report->suspects[i];
    if (supine_input_judge(SUPINE_INPUT_FIELDS_RUN_ERROR, suspect->ratio) != SUPINE_INPUT_TAKEN) {
      supine_findings_warn(
          findings,
          "%s: row %zu: the other rows predict its displacement with %.0f "
          "times the usual error: check the direction and the displacement of this "
          "run",
          name, suspect->run, suspect->ratio);
    }
  }
}

/* Tell of displacements in another unit, and of gravity in other axes. */
static void check_motion(const char *name, const supine_fit_frame *frame,
                         supine_findings *findings) {
  static const char *const axes[] = {"-z", "-y", "-x", "", "x", "y", "z"};
  const supine_number_text moved = supine_text_distance(frame->moved_mm);
  if (supine_input_judge(SUPINE_INPUT_FIELDS_UNIT, frame->moved_mm) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(findings,
                         "%s: gravity moves the lungs by %s mm RMS only: are the "
                         "displacements in metres or centimetres? Write them in the unit of the "
                         "points",
                         name, moved.text);
  }
  if (supine_input_judge(SUPINE_INPUT_FIELDS_LARGE, frame->moved_mm) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(findings,
                         "%s: gravity moves the lungs by %s mm RMS, more than it moves "
                         "those of people: check the unit of the displacements, and the stiffness "
                         "and the density of the tissue",
                         name, moved.text);
  }
  if (supine_input_judge(SUPINE_INPUT_FIELDS_FRAME, frame->gain) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(
        findings,
        "%s: the lungs do not sag along gravity. Displacements along "
        "x, y and z follow %s, %s and %s of gravity: check that both have the axes "
        "of the surface, and that gravity points to where things fall",
        name, axes[frame->axis[0] + 3], axes[frame->axis[1] + 3], axes[frame->axis[2] + 3]);
  }
}

supine_status supine_fields_check_fit(const char *name, const supine_fit_report *report,
                                      supine_findings *findings, supine_error *error) {
  const double part = left_out(report);
  const supine_input_verdict verdict = supine_input_judge(SUPINE_INPUT_FIELDS_LEFT_OUT, part);
  SUPINE_REFUSE_IF(
      verdict == SUPINE_INPUT_REFUSED, error, SUPINE_ERROR_FORMAT,
      "%s: the directions of gravity do not predict the displacements: runs that are left out have "
      "an error of %.0f %% of what gravity changes. Check that each row of displacement is the run "
      "of "
      "its row of gravity: plans of version 0.2 and before were sorted, from +z to -z, and those "
      "of "
      "this version are not. Pair results of an old plan with the directions that they were run "
      "with; or simulate more directions",
      name, 100.0 * part);
  if (verdict == SUPINE_INPUT_TOLD) {
    supine_findings_warn(
        findings,
        "%s: the directions of gravity hardly predict the displacements: runs that are "
        "left out have an error of %.0f %% of what gravity changes. Check that the rows of gravity "
        "and displacement are in the same order, or simulate more directions",
        name, 100.0 * part);
  }
  check_runs(name, report, findings);
  check_motion(name, &report->frame, findings);
  return SUPINE_OK;
}
