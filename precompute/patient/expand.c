/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit expandability to motion, and test whether it improves the prediction of held-out blocks. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>

#include "precompute/patient/matching.h"

#include "sh/base/vec3.h"

static const double apart = 35.0; /* largest distance of a vertex from the nearest centre, mm */
static const double overlapping = 1.5; /* radius of a region over that distance */

enum {
  CANDIDATES = 8192, /* most vertices considered as centres */
  LANES = 16,        /* regions solved for at once */
  ROUNDS = 5         /* rounds of fitting and of finding the nearest points */
};

static const double neighbours_differ = 0.3; /* prior deviation of the factors of neighbours */
static const double regions_differ = 1.0;    /* prior deviation of a region's factor from 1 */
static const double noise_least = 0.3;       /* least noise of a surface point, mm */
static const double together = 10.0;         /* rows with a common error, which count as one */

static const double near_by = 1.7; /* largest distance of neighbouring centres over the least one */
static const double worth =
    0.95; /* largest held-out RMS with regions over that without at which they are kept */

/* Find the vertex of a side farthest from the regions, and its distance, mm. */
static size_t farthest(const supine_lungs *lungs, const supine_patient_stiffness *stiffness,
                       int side, double *distance) {
  size_t found = 0;
  const size_t step = lungs->mesh.vertex_count / CANDIDATES + 1;
  *distance = 0.0;
  for (size_t i = 0; i < lungs->mesh.vertex_count; i += step) {
    double nearest = supine_patient_side_of(lungs, i) == side ? INFINITY : 0.0;
    for (size_t k = 0; k < stiffness->count; ++k) {
      if (stiffness->mode[k].side == side) {
        nearest =
            fmin(nearest, supine_distance(stiffness->mode[k].centre, lungs->mesh.vertices + 3 * i));
      }
    }
    if (nearest > *distance) {
      *distance = nearest;
      found = i;
    }
  }
  return found;
}

/* Spread regions with a = 1 over the lungs' surface, some 45 mm apart. */
static void spread_regions(const supine_lungs *lungs, supine_patient_stiffness *stiffness) {
  *stiffness = (supine_patient_stiffness){0};
  for (int side = 1; side >= -1; side -= 2) {
    const size_t first = stiffness->count;
    double distance;
    size_t vertex = farthest(lungs, stiffness, side, &distance);
    while (distance > apart && stiffness->count - first < SUPINE_PATIENT_REGIONS_MAX / 2) {
      supine_patient_mode *mode = &stiffness->mode[stiffness->count++];
      *mode = (supine_patient_mode){.side = side, .value = 1.0};
      memcpy(mode->centre, lungs->mesh.vertices + 3 * vertex, sizeof mode->centre);
      vertex = farthest(lungs, stiffness, side, &distance);
    }
    for (size_t k = first; k < stiffness->count; ++k) {
      stiffness->mode[k].radius = overlapping * distance;
    }
  }
}

/* Compute the prior precision [count, count] of a - 1. */
static void find_precision(const supine_patient_stiffness *regions, double *precision) {
  const supine_patient_mode *mode = regions->mode;
  const size_t n = regions->count;
  double nearest = INFINITY;
  for (size_t i = 0; i < n * n; ++i) {
    const double distance = supine_distance(mode[i / n].centre, mode[i % n].centre);
    nearest = i / n != i % n ? fmin(nearest, distance) : nearest;
    precision[i] = i / n == i % n ? pow(regions_differ, -2.0) : 0.0;
  }
  for (size_t i = 0; i < n * n; ++i) {
    const size_t j = i / n;
    const size_t k = i % n;
    if (j != k && mode[j].side == mode[k].side &&
        supine_distance(mode[j].centre, mode[k].centre) < near_by * nearest) {
      precision[j * n + j] += pow(neighbours_differ, -2.0);
      precision[i] -= pow(neighbours_differ, -2.0);
    }
  }
}

/* Solve for the force on each region alone, LANES at a time. */
static supine_status find_responses(const supine_patient_matching *m,
                                    const supine_patient_stiffness *regions,
                                    const double gravity[3], double *response,
                                    supine_error *error) {
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  const size_t n = m->rest->mesh.vertex_count;
  double range[2];
  double *force = malloc(n * sizeof *force);
  double *alone = malloc(n * LANES * sizeof *alone);
  double *caught = malloc(n * LANES * sizeof *caught);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (force == NULL || alone == NULL || caught == NULL ||
      supine_physics_height_range(m->rest, model.force.pair, 1, gravity, range, range + 1) !=
          SUPINE_OK) {
    (void)supine_error_set(error, status, "no memory for %zu vertices", n);
    goto cleanup;
  }
  const supine_gravities gravities = {1, gravity, range, range + 1};
  supine_physics_force(m->rest, &model.force, &gravities, n, NULL, force);
  status = supine_physics_equilibrium_set_stiffness(m->equilibrium, NULL, error);
  for (size_t first = 0; first < regions->count && status == SUPINE_OK; first += LANES) {
    const size_t lanes = regions->count - first < LANES ? regions->count - first : LANES;
    for (size_t i = 0; i < n; ++i) {
      double shares[SUPINE_PATIENT_REGIONS_MAX];
      supine_patient_stiffness_shares(regions, m->rest, i, shares);
      for (size_t r = 0; r < lanes; ++r) {
        alone[i * lanes + r] = force[i] * shares[first + r];
      }
    }
    status = supine_physics_equilibrium_solve(m->equilibrium, lanes, alone, caught, error);
    for (size_t i = 0; i < m->count && status == SUPINE_OK; ++i) {
      memcpy(response + i * regions->count + first, caught + m->match[i].vertex * lanes,
             lanes * sizeof *caught);
    }
  }
cleanup:
  free(force);
  free(alone);
  free(caught);
  return status;
}

/* Set the rows' force from the regions' a; NULL: uniform tissue. */
static void set_forces(supine_patient_matching *m, size_t count, const double *response,
                       const double *a) {
  for (size_t i = 0; i < m->count; ++i) {
    supine_patient_row *row = &m->rows[i];
    row->response = response + i * count;
    memset(row->place.force, 0, sizeof row->place.force);
    for (size_t k = 0; k < count; ++k) {
      row->place.force[0] += row->response[k] * (a != NULL ? a[k] : 1.0);
    }
  }
}

/* Alternate between fitting law and regions, and finding the nearest points with full weights: the
 * law's residual is the signal here. */
static supine_status settle(supine_patient_matching *m, const double *response,
                            supine_patient_fit_options *options, supine_patient *patient,
                            supine_patient_stiffness *regions, supine_error *error) {
  supine_patient_krige krige = {0};
  double share[SUPINE_PATIENT_REGIONS_MAX];
  supine_patient_matching_find(m);
  supine_status status = supine_patient_matching_weigh(m, INFINITY, error);
  for (size_t round = 0; round < ROUNDS && status == SUPINE_OK; ++round) {
    options->noise = sqrt(together) * fmax(noise_least, m->rms) / m->rows[0].noise;
    set_forces(m, regions->count, response, NULL);
    status = supine_patient_krige_fit(options, m->rows, m->count, &krige, error);
    if (status == SUPINE_OK) {
      supine_patient_krige_take(&krige, patient);
      supine_patient_krige_resolution(&krige, share);
      for (size_t k = 0; k < regions->count; ++k) {
        regions->mode[k].value = krige.region[k];
        regions->mode[k].seen = share[k];
      }
      set_forces(m, regions->count, response, krige.region);
      (void)supine_patient_matching_place(m, patient);
      supine_patient_matching_find(m);
      status = supine_patient_matching_weigh(m, INFINITY, error);
    }
    supine_patient_krige_free(&krige);
  }
  set_forces(m, regions->count, response, NULL);
  return status;
}

supine_status supine_patient_expand(supine_patient_matching *matching,
                                    const supine_patient_fit_options *options,
                                    supine_patient *patient, supine_patient_stiffness *stiffness,
                                    supine_patient_expand_report *report, supine_error *error) {
  supine_patient_matching *m = matching;
  supine_patient_fit_options wanted = *options;
  supine_patient_fit_report scores;
  *report = (supine_patient_expand_report){.tried = true};
  spread_regions(m->rest, stiffness);
  const size_t n = stiffness->count;
  double *response = malloc((m->count * n + 1) * sizeof *response);
  double *precision = malloc((n * n + 1) * sizeof *precision);
  supine_status status =
      response == NULL || precision == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu regions", n)
          : find_responses(m, stiffness, options->gravity, response, error);
  if (status == SUPINE_OK) {
    find_precision(stiffness, precision);
    wanted.region_count = n;
    wanted.precision = precision;
    status = settle(m, response, &wanted, patient, stiffness, error);
  }
  if (status == SUPINE_OK) {
    status = supine_patient_fit(&wanted, m->rows, m->count, 0, patient, &scores, error);
  }
  if (status == SUPINE_OK) {
    for (size_t with = 0; with < 2; ++with) {
      report->fitted[with] = scores.fitted[SUPINE_PATIENT_SCORE_LAW + with];
      report->held_out[with] = scores.held_out[SUPINE_PATIENT_SCORE_LAW + with];
    }
    report->kept = report->held_out[1] < worth * report->held_out[0];
    stiffness->count = report->kept ? n : 0;
    for (size_t k = 0; k < stiffness->count; ++k) {
      report->unseen += stiffness->mode[k].seen < SUPINE_PATIENT_SEEN ? 1.0 : 0.0;
    }
    status = supine_patient_matching_solve(m, stiffness, error);
  }
  free(response);
  free(precision);
  return status;
}
