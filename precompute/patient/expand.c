/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit the expandability (1 / relative stiffness) of each region of the lungs, and test the result
 * on held-out vertices. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/patient/matching.h"

#include "base/vec3.h"

/* Largest distance from a vertex to the nearest centre of a region, mm. */
static const double centre_distance_most = 35.0;

/* Radius of a region / largest distance from a vertex to the nearest centre of a region. */
static const double radius_ratio = 1.5;

enum {
  CANDIDATES = 8192, /* largest number of vertices tried as the centre of a region */
  LANES = 16,        /* largest number of regions in one call of the equilibrium solver */
  ROUNDS = 5         /* number of fits, each followed by a matching of the surfaces */
};

/* Prior standard deviation of a region's expandability (1 / relative stiffness, near 1), and of its
 * difference between neighbouring regions. */
static const double region_deviation = 1.0, neighbour_deviation = 0.3;

/* Lower bound on the standard deviation of the distance between the matched surfaces, mm. */
static const double noise_least = 0.3;
/* The errors of about this many vertices are correlated, so that they count as one measurement. */
static const double vertices_per_error = 10.0;

/* Regions are neighbours if the distance between their centres is less than this number times the
 * smallest distance between any two centres. */
static const double neighbour_distance_ratio = 1.7;

/* Regions are kept if the held-out error with regions / that without is less than this. */
static const double kept_ratio = 0.95;

/* Find the vertex of one lung that is farthest from all centres of regions. Write its distance from
 * the nearest centre into `distance`. */
static size_t farthest(const supine_lungs *lungs, const supine_patient_stiffness *stiffness,
                       int side, double *distance) {
  size_t found = 0;
  const size_t step = lungs->mesh.vertex_count / CANDIDATES + 1;
  *distance = 0.0;
  for (size_t i = 0; i < lungs->mesh.vertex_count; i += step) {
    double nearest = supine_patient_side_of(lungs, i) == side ? INFINITY : 0.0;
    for (size_t k = 0; k < stiffness->count; ++k) {
      if (stiffness->region[k].side == side) {
        nearest = fmin(nearest,
                       supine_distance(stiffness->region[k].centre, lungs->mesh.vertices + 3 * i));
      }
    }
    if (nearest > *distance) {
      *distance = nearest;
      found = i;
    }
  }
  return found;
}

/* Add regions until every vertex is near the centre of a region, or the array is full. */
static void place_regions(const supine_lungs *lungs, supine_patient_stiffness *stiffness) {
  *stiffness = (supine_patient_stiffness){0};
  for (int side = 1; side >= -1; side -= 2) {
    const size_t first = stiffness->count;
    double distance;
    size_t vertex = farthest(lungs, stiffness, side, &distance);
    while (distance > centre_distance_most &&
           stiffness->count - first < SUPINE_PATIENT_REGIONS_MAX / 2) {
      supine_patient_region *region = &stiffness->region[stiffness->count++];
      *region = (supine_patient_region){.side = side, .expandability = 1.0};
      memcpy(region->centre, lungs->mesh.vertices + 3 * vertex, sizeof region->centre);
      vertex = farthest(lungs, stiffness, side, &distance);
    }
    for (size_t k = first; k < stiffness->count; ++k) {
      stiffness->region[k].radius = radius_ratio * distance;
    }
  }
}

static void find_prior_precision(const supine_patient_stiffness *regions, double *precision) {
  const supine_patient_region *region = regions->region;
  const size_t n = regions->count;
  double nearest = INFINITY;
  for (size_t i = 0; i < n * n; ++i) {
    const double distance = supine_distance(region[i / n].centre, region[i % n].centre);
    nearest = i / n != i % n ? fmin(nearest, distance) : nearest;
    precision[i] = i / n == i % n ? pow(region_deviation, -2.0) : 0.0;
  }
  for (size_t i = 0; i < n * n; ++i) {
    const size_t j = i / n;
    const size_t k = i % n;
    if (j != k && region[j].side == region[k].side &&
        supine_distance(region[j].centre, region[k].centre) < neighbour_distance_ratio * nearest) {
      precision[j * n + j] += pow(neighbour_deviation, -2.0);
      precision[i] -= pow(neighbour_deviation, -2.0);
    }
  }
}

/* Compute response [vertex, region]: the force at each vertex listed in m->match if only one region
 * can expand, with the expandability (1 / stiffness) 1. Each response is
 * smoothed over the surface. */
static supine_status find_responses(const supine_patient_matching *m,
                                    const supine_patient_stiffness *regions,
                                    const double gravity[3], double *response,
                                    supine_error *error) {
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  const size_t n = m->fuller->mesh.vertex_count;
  double range[2];
  double *force = malloc(n * sizeof *force);
  double *region_force = malloc(n * LANES * sizeof *region_force);
  double *spread_force = malloc(n * LANES * sizeof *spread_force);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (force == NULL || region_force == NULL || spread_force == NULL ||
      supine_physics_height_range(m->fuller, model.force.pair, 1, gravity, range, range + 1) !=
          SUPINE_OK) {
    (void)supine_error_set(error, status, "no memory for %zu vertices", n);
    goto cleanup;
  }
  const supine_gravities gravities = {1, gravity, range, range + 1};
  supine_physics_force(m->fuller, &model.force, &gravities, n, NULL, force);
  status = supine_physics_equilibrium_set_stiffness(m->equilibrium, NULL, error);
  for (size_t first = 0; first < regions->count && status == SUPINE_OK; first += LANES) {
    const size_t lanes = regions->count - first < LANES ? regions->count - first : LANES;
    for (size_t i = 0; i < n; ++i) {
      double shares[SUPINE_PATIENT_REGIONS_MAX];
      supine_patient_stiffness_shares(regions, m->fuller, i, shares);
      for (size_t r = 0; r < lanes; ++r) {
        region_force[i * lanes + r] = force[i] * shares[first + r];
      }
    }
    status =
        supine_physics_equilibrium_solve(m->equilibrium, lanes, region_force, spread_force, error);
    for (size_t i = 0; i < m->count && status == SUPINE_OK; ++i) {
      memcpy(response + i * regions->count + first, spread_force + m->match[i].vertex * lanes,
             lanes * sizeof *spread_force);
    }
  }
cleanup:
  free(force);
  free(region_force);
  free(spread_force);
  return status;
}

/* Set the force at each vertex listed in m->match to the sum over all regions of a[region] *
 * response[vertex, region]. `a` holds the regions' values of 1 / stiffness, or is NULL for 1. */
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

/* Fit the stiffness of the regions and match the surfaces in turn, without robust weights. */
static supine_status iterate(supine_patient_matching *m, const double *response,
                             supine_patient_fit_options *options, supine_patient *patient,
                             supine_patient_stiffness *regions, supine_error *error) {
  supine_patient_krige krige = {0};
  double share[SUPINE_PATIENT_REGIONS_MAX];
  supine_patient_matching_find(m);
  supine_status status = supine_patient_matching_weigh(m, INFINITY, error);
  for (size_t round = 0; round < ROUNDS && status == SUPINE_OK; ++round) {
    options->noise = sqrt(vertices_per_error) * fmax(noise_least, m->rms) / m->rows[0].noise;
    set_forces(m, regions->count, response, NULL);
    status = supine_patient_krige_fit(options, m->rows, m->count, &krige, error);
    if (status == SUPINE_OK) {
      supine_patient_krige_copy_law(&krige, patient);
      supine_patient_krige_resolution(&krige, share);
      for (size_t k = 0; k < regions->count; ++k) {
        regions->region[k].expandability = krige.region[k];
        regions->region[k].determined = share[k];
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
  supine_patient_fit_options region_options = *options;
  supine_patient_fit_report fit_report;
  *report = (supine_patient_expand_report){.tried = true};
  place_regions(m->fuller, stiffness);
  const size_t n = stiffness->count;
  double *response = malloc((m->count * n + 1) * sizeof *response);
  double *precision = malloc((n * n + 1) * sizeof *precision);
  supine_status status =
      response == NULL || precision == NULL
          ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu regions", n)
          : find_responses(m, stiffness, options->gravity, response, error);
  if (status == SUPINE_OK) {
    find_prior_precision(stiffness, precision);
    region_options.region_count = n;
    region_options.prior_precision = precision;
    status = iterate(m, response, &region_options, patient, stiffness, error);
  }
  if (status == SUPINE_OK) {
    status = supine_patient_fit(&region_options, m->rows, m->count, 0, patient, &fit_report, error);
  }
  if (status == SUPINE_OK) {
    for (size_t with = 0; with < 2; ++with) {
      report->fitted[with] = fit_report.fitted[SUPINE_PATIENT_SCORE_LAW + with];
      report->held_out[with] = fit_report.held_out[SUPINE_PATIENT_SCORE_LAW + with];
    }
    report->kept = report->held_out[1] < kept_ratio * report->held_out[0];
    stiffness->count = report->kept ? n : 0;
    for (size_t k = 0; k < stiffness->count; ++k) {
      report->undetermined +=
          stiffness->region[k].determined < SUPINE_PATIENT_DETERMINED ? 1.0 : 0.0;
    }
    status = supine_patient_matching_solve(m, stiffness, error);
  }
  free(response);
  free(precision);
  return status;
}
