/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure the volumes of the lungs in the runs of a simulator, and group the runs. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/vec3.h"
#include "precompute/fields/volumes.h"

/* Distance of two unit vectors that are the same direction of gravity. Simulators and their authors
 * print them with five digits or more. */
static const double same_direction = 1e-4;

/* Largest difference between the volumes of runs for the same direction, divided by their mean,
 * at which they are repetitions of one run. */
static const double same_volume = 0.01;

/* Compute the volume of each lung in a run minus that of the given surface, mL. */
static void measure_run(const supine_fit *fit, size_t run, double *moved) {
  const supine_lungs *lungs = fit->lungs;
  const size_t m = fit->fields->run_count;
  const double *u = fit->fields->displacement + 3 * lungs->mesh.vertex_count * run;
  for (size_t i = 0; i < 3 * lungs->mesh.vertex_count; ++i) {
    moved[i] = lungs->mesh.vertices[i] + u[i];
  }
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    supine_mesh part = supine_lungs_part(lungs, lung);
    part.vertices = moved;
    fit->volume[lung * m + run] = 1e-3 * supine_mesh_volume(&part) - lungs->volume[lung];
  }
}

static double total_of(const supine_fit *fit, size_t run) {
  double total = 0.0;
  for (size_t lung = 0; lung < fit->lungs->lung_count; ++lung) {
    total += fit->lungs->volume[lung] + fit->volume[lung * fit->fields->run_count + run];
  }
  return total;
}

size_t supine_fields_number_directions(const supine_fields *fields, size_t *direction) {
  size_t count = 0;
  for (size_t run = 0; run < fields->run_count; ++run) {
    direction[run] = count;
    for (size_t earlier = 0; earlier < run; ++earlier) {
      if (supine_distance(fields->directions + 3 * run, fields->directions + 3 * earlier) <
          same_direction) {
        direction[run] = direction[earlier];
      }
    }
    count += direction[run] == count;
  }
  return count;
}

/* Rank the volume of a run among those of the same direction, and refuse a run that repeats
 * another.
 * @param count  written: number of runs for the same direction */
static supine_status rank_run(const supine_fit *fit, const size_t *direction, size_t run,
                              size_t *rank, size_t *count, supine_error *error) {
  *rank = 0;
  *count = 0;
  for (size_t other = 0; other < fit->fields->run_count; ++other) {
    if (direction[other] != direction[run]) {
      continue;
    }
    const double total = total_of(fit, run);
    const double apart = total_of(fit, other) - total;
    SUPINE_REFUSE_IF(
        other < run && fabs(apart) < same_volume * total, error, SUPINE_ERROR_FORMAT,
        "rows %zu and %zu have the same direction of gravity and volumes within %g %%: "
        "keep one of them, or displacements of other volumes",
        other, run, 100.0 * same_volume);
    *rank += apart < 0.0;
    ++*count;
  }
  return SUPINE_OK;
}

/* Refuse runs of which only some directions are given again. */
static supine_status check_repeated(const supine_fit *fit, const size_t *direction,
                                    supine_error *error) {
  const size_t m = fit->fields->run_count;
  size_t single = 0;
  size_t again = 0; /* last run whose direction was given before */
  size_t before = 0;
  for (size_t run = 0; run < m; ++run) {
    size_t count = 0;
    for (size_t other = 0; other < m; ++other) {
      count += direction[other] == direction[run];
      if (other < run && direction[other] == direction[run]) {
        again = run;
        before = other;
      }
    }
    single += count == 1;
  }
  const double share = (double)single / (double)fit->report.direction_count;
  const supine_input_verdict verdict =
      again > 0 ? supine_input_judge(SUPINE_INPUT_FIELDS_REPEATED, share) : SUPINE_INPUT_TAKEN;
  SUPINE_REFUSE_IF(
      verdict == SUPINE_INPUT_REFUSED, error, SUPINE_ERROR_FORMAT,
      "rows %zu and %zu have the same direction of gravity and other displacements, but "
      "%zu of %zu directions are given once: keep one run for each direction, or "
      "simulate all directions at several volumes",
      before, again, single, fit->report.direction_count);
  return SUPINE_OK;
}

/* Map volumes to -1 to 1.
 * @param range   written: the smallest and the largest
 * @param mapped  [runs] written; it may be `volume` */
static void map_to_unit(size_t runs, const double *volume, double range[2], double *mapped) {
  range[0] = range[1] = volume[0];
  for (size_t run = 0; run < runs; ++run) {
    range[0] = fmin(range[0], volume[run]);
    range[1] = fmax(range[1], volume[run]);
  }
  for (size_t run = 0; run < runs; ++run) {
    mapped[run] = 2.0 * (volume[run] - range[0]) / (range[1] - range[0]) - 1.0;
  }
}

void supine_fields_map_totals(const supine_fit *fit, double *total, double range[2]) {
  const size_t m = fit->fields->run_count;
  memset(total, 0, m * sizeof *total);
  for (size_t i = 0; i < m * fit->lungs->lung_count; ++i) {
    total[i % m] += fit->volume[i];
  }
  map_to_unit(m, total, range, total);
}

/* Groups of runs that are being made. */
typedef struct grouping {
  size_t run_count;
  size_t count;
  size_t *begin; /* [count + 1] */
  size_t *run;
} grouping;

static grouping grouping_begin(size_t run_count, size_t most, supine_arena *memory) {
  return (grouping){.run_count = run_count,
                    .begin = supine_arena_zeros(memory, 2 * run_count + 1, sizeof(size_t)),
                    .run = supine_arena_zeros(memory, most, sizeof(size_t))};
}

/* Append a group of all runs whose `key` is `value`, if there are any. */
static void grouping_add(grouping *made, const size_t *key, size_t value) {
  const size_t first = made->begin[made->count];
  size_t last = first;
  for (size_t run = 0; run < made->run_count; ++run) {
    if (key[run] == value) {
      made->run[last++] = run;
    }
  }
  if (last > first) {
    made->begin[++made->count] = last;
  }
}

/* Places of a volume among those of its direction, in place of a rank between them. */
static const size_t smallest = SIZE_MAX - 1;
static const size_t largest = SIZE_MAX;

/* Return where a volume stands among the `count` that one direction was simulated at: `smallest`,
 * `largest`, or otherwise `rank`, the number of smaller ones. */
static size_t place_of(size_t rank, size_t count) {
  if (rank == 0) {
    return smallest;
  }
  return rank + 1 == count ? largest : rank;
}

supine_status supine_fields_volumes_measure(supine_fit *fit, supine_error *error) {
  const size_t m = fit->fields->run_count;
  const size_t lungs = fit->lungs->lung_count;
  const bool closed = fit->lungs->topology.closed;
  SUPINE_ARENA arena = {0};
  double *moved = supine_arena_take(&arena, fit->lungs->mesh.vertex_count, 3 * sizeof *moved);
  size_t *direction = supine_arena_take(&arena, m, sizeof *direction);
  size_t *place = supine_arena_zeros(&arena, m, sizeof *place);
  grouping groups = grouping_begin(m, 2 * m, &fit->memory);
  grouping ends = grouping_begin(m, 2 * m, &fit->memory);
  fit->volume = supine_arena_zeros(&fit->memory, lungs * m, sizeof *fit->volume);
  fit->parameter = supine_arena_zeros(&fit->memory, lungs * m, sizeof *fit->parameter);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu fields", m));
  SUPINE_TRY(supine_arena_check(&fit->memory, error, "%zu fields", m));
  fit->report.direction_count = supine_fields_number_directions(fit->fields, direction);
  SUPINE_REFUSE_IF(fit->report.direction_count < m && !closed, error, SUPINE_ERROR_OPEN_SURFACE,
                   "two runs have the same direction of gravity, but the surface is open, so that "
                   "their volumes are unknown: close it, or keep one run for each direction");
  SUPINE_TRY(check_repeated(fit, direction, error));
  size_t levels = 1;
  if (closed) {
    for (size_t run = 0; run < m; ++run) {
      measure_run(fit, run, moved);
    }
    for (size_t run = 0; run < m; ++run) {
      size_t rank = 0;
      size_t count = 0;
      SUPINE_TRY(rank_run(fit, direction, run, &rank, &count, error));
      place[run] = place_of(rank, count);
      levels = count > levels ? count : levels;
    }
  }
  for (size_t d = 0; d < fit->report.direction_count; ++d) {
    grouping_add(&groups, direction, d);
  }
  fit->direction_groups = groups.count;
  if (levels > 1) {
    for (size_t lung = 0; lung < lungs; ++lung) {
      map_to_unit(m, fit->volume + lung * m, fit->range[lung], fit->parameter + lung * m);
    }
    for (size_t rank = 1; rank + 1 < levels; ++rank) {
      grouping_add(&groups, place, rank);
    }
    grouping_add(&ends, place, smallest);
    grouping_add(&ends, place, largest);
  }
  fit->report.volume_count = levels;
  fit->groups = (supine_run_groups){groups.count, groups.begin, groups.run};
  fit->ends = (supine_run_groups){ends.count, ends.begin, ends.run};
  return SUPINE_OK;
}
