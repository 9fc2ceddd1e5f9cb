/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure how well kriging predicts the displacements of landmarks in the lungs of five people.
 * Observe ten landmarks of a person, and predict the displacements of all others, from exhaled to
 * inhaled and from inhaled to exhaled. Print the RMS error in mm and the percentage of landmarks
 * within the predicted 95 % interval. Then print the time that the run-time library needs for a
 * surface.
 *
 *     bench_locate [FOLDER OF LANDMARKS]
 *
 * Kriging corrects the displacements of a simple model: the displacement that the force on a point
 * of supine lungs causes, times a scale. (The spread of force between points is left out.) The
 * prior mean of a person's scale is the mean of the other four people's scales. The prior standard
 * deviation is 30 % of the prior mean. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>

#include <supine/doubt.h>
#include <supine/locate.h>

#include "base/clock.h"
#include "base/csv.h"
#include "precompute/physics/model.h"
#include "runtime/kriging.h"
#include "tests/helpers/runtime_fixture.h"

enum { PEOPLE = 5, POINTS_MAX = 128, DRAWN = 10, DRAWS = 40, STEPS = 4 };

/* Relative prior standard deviation of the factor on a person's displacements. */
static const double spread = 0.3;

typedef struct person {
  size_t count; /* number of landmarks */
  /* [count, 3] positions, true displacements, and those by the law with a factor of 1, mm */
  double from[3 * POINTS_MAX], moved[3 * POINTS_MAX], law[3 * POINTS_MAX];
  double centre_distance[POINTS_MAX]; /* [count] squared distance from the centre of a unit box */
  size_t lung[POINTS_MAX];
} person;

static void need(supine_status status, const supine_error *error) {
  if (status != SUPINE_OK) {
    (void)fprintf(stderr, "%s\n", error->message);
    exit(EXIT_FAILURE);
  }
}

/* Compute the displacements of `points`, one for each landmark, by the model with a scale of 1, in
 * `p->law`. The bounding box of the points replaces that of the lungs. Scale it to [-1, 1]^3 for
 * `p->centre_distance`. */
static void find_law(person *p, const double *points) {
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  const double *c = model.direction.c;
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (size_t i = 0; i < 3 * p->count; ++i) {
    low[i % 3] = fmin(low[i % 3], points[i]);
    high[i % 3] = fmax(high[i % 3], points[i]);
  }
  const double middle = 0.5 * (low[0] + high[0]);
  for (size_t j = 0; j < p->count; ++j) {
    const double *x = points + 3 * j;
    const double side = x[0] > middle ? 1 : -1;
    const double box[3] = {fabs(x[0] - middle) / (high[0] - middle),
                           (high[1] - x[1]) / (high[1] - low[1]),
                           (high[2] - x[2]) / (high[2] - low[2])};
    double force = model.force.base + model.force.gain * (1 - box[1]);
    p->centre_distance[j] = 0;
    for (size_t i = 0; i < 3; ++i) {
      const double half = 0.5 * (high[i] - low[i]);
      force += model.force.box[i] * box[i];
      p->centre_distance[j] += pow((x[i] - low[i] - half) / half, 2);
    }
    const double sign[3] = {side, -1, -1};
    for (size_t i = 0; i < 3; ++i) {
      p->law[3 * j + i] = force * sign[i] * c[2 * i] * pow(box[i], c[2 * i + 1]);
    }
    p->lung[j] = x[0] > middle;
  }
}

static void load(const char *folder, const char *name, bool inhaling, person *p) {
  static const char *const columns[] = {"im1_x", "im1_y", "im1_z", "im2_x", "im2_y", "im2_z"};
  supine_csv csv = {0};
  supine_error error;
  char path[512];
  (void)snprintf(path, sizeof path, "%s/case%s_landmarks_mm.csv", folder, name);
  *p = (person){0};
  need(supine_csv_open(path, columns, 6, 6, &csv, &error), &error);
  for (bool more = true; p->count < POINTS_MAX;) {
    need(supine_csv_next(&csv, &more, &error), &error);
    if (!more) {
      break;
    }
    for (size_t i = 0; i < 3; ++i) {
      double inhaled = 0;
      double exhaled = 0;
      need(supine_csv_number(&csv, i, columns[i], &inhaled, &error), &error);
      need(supine_csv_number(&csv, 3 + i, columns[3 + i], &exhaled, &error), &error);
      p->from[3 * p->count + i] = inhaling ? exhaled : inhaled;
      p->moved[3 * p->count + i] = inhaling ? inhaled - exhaled : exhaled - inhaled;
    }
    ++p->count;
  }
  supine_csv_close(&csv);
  find_law(p, p->from);
}

static double fit_scale(const person *p) {
  double mean[2][3] = {{0}};
  double lu = 0;
  double ll = 0;
  for (size_t i = 0; i < 3 * p->count; ++i) {
    mean[0][i % 3] += p->law[i] / (double)p->count;
    mean[1][i % 3] += p->moved[i] / (double)p->count;
  }
  for (size_t i = 0; i < 3 * p->count; ++i) {
    const double l = p->law[i] - mean[0][i % 3];
    lu += l * (p->moved[i] - mean[1][i % 3]);
    ll += l * l;
  }
  return lu / ll;
}

/* Evaluate the model law(p) at the inhaled position p of each landmark. p is not known, but the
 * exhaled position x is. Solve p = x + scale * law(p) by iteration from p = x. */
static void find_law_at_inhaled(person *p, double scale) {
  double full[3 * POINTS_MAX];
  for (int step = 0; step < 30; ++step) {
    for (size_t i = 0; i < 3 * p->count; ++i) {
      full[i] = p->from[i] + scale * p->law[i];
    }
    find_law(p, full);
  }
}

static double length(const double *u) {
  return sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
}

static void set_point(const person *p, size_t j, double scale, double prior,
                      supine_kriging_point *point) {
  const double *law = p->law + 3 * j;
  *point =
      (supine_kriging_point){.size = fabs(scale) * length(law), .noise = 2, .lung = p->lung[j]};
  for (size_t i = 0; i < 3; ++i) {
    point->position[i] = p->from[3 * j + i];
    point->residual[i] = p->moved[3 * j + i] - scale * law[i];
    point->volume[i] = spread * prior * law[i];
  }
}

/* Sums and counts over DRAWS random choices of observed landmarks, for one person. */
typedef struct sums {
  double error;       /* sum of squared errors, mm^2 */
  double variance;    /* sum of the variances predicted by kriging, mm^2 */
  double points;      /* number of unobserved points */
  double inside_band; /* number of unobserved points within the predicted 95 % interval */
  double left_out;    /* observed points over 3 expected errors from their prediction */
  double observed;    /* number of observed points */
} sums;

static void predict(const person *p, const size_t *drawn, size_t count, double prior, sums *s) {
  static double space[DRAWN * (2 * DRAWN + 22)];
  supine_kriging_point points[DRAWN];
  supine_kriging fit;
  supine_error error;
  double scale = prior;
  for (int step = 0; step < STEPS; ++step) {
    for (size_t j = 0; j < count; ++j) {
      set_point(p, drawn[j], scale, prior, &points[j]);
    }
    need(supine_kriging_fit(&(supine_kriging_options){.model = supine_kriging_default,
                                                      .volume = true,
                                                      .volume_mean = (1 - scale / prior) / spread},
                            count, points, space, &fit, &error),
         &error);
    scale += step + 1 < STEPS ? fit.terms[3] * spread * prior : 0;
  }
  for (size_t j = 0; j < count; ++j) {
    double left[3];
    double scratch[4 * SUPINE_KRIGING_LEFT_MAX * DRAWN];
    const double sigma = supine_kriging_leave_out(&fit, 1, &j, left, scratch);
    s->left_out += length(left) > 3.0 * sigma;
    s->observed += 1;
  }
  for (size_t j = 0; j < p->count; ++j) {
    bool seen = false;
    for (size_t k = 0; k < count; ++k) {
      seen = seen || drawn[k] == j;
    }
    if (seen) {
      continue;
    }
    supine_kriging_point at;
    set_point(p, j, scale, prior, &at);
    const float position[3] = {(float)at.position[0], (float)at.position[1], (float)at.position[2]};
    const float volume[3] = {(float)at.volume[0], (float)at.volume[1], (float)at.volume[2]};
    const float size = (float)at.size;
    float shift[3];
    float variance = 0;
    double square = 0;
    supine_kriging_predict(&fit, &(supine_kriging_target){1, p->lung[j], position, &size, volume},
                           shift, &variance);
    for (size_t i = 0; i < 3; ++i) {
      square += pow(at.residual[i] - (double)shift[i], 2);
    }
    s->error += square;
    s->variance += (double)variance;
    s->inside_band += square <= 1.8 * 1.8 * (double)variance;
    s->points += 1;
  }
}

static int by_distance(const void *a, const void *b, void *of) {
  const double *distance = of;
  const double x = distance[*(const size_t *)a];
  const double y = distance[*(const size_t *)b];
  return (x > y) - (x < y);
}

static void study(const person *people, size_t number, double prior, bool central, sums *s) {
  const person *p = &people[number];
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  size_t order[POINTS_MAX];
  size_t drawn[DRAWN];
  for (size_t j = 0; j < p->count; ++j) {
    order[j] = j;
  }
  qsort_r(order, p->count, sizeof *order, by_distance, (void *)p->centre_distance);
  gsl_rng_set(random, 20260 + number);
  for (int draw = 0; draw < DRAWS; ++draw) {
    (void)gsl_ran_choose(random, drawn, DRAWN, order, central ? p->count / 3 : p->count,
                         sizeof *order);
    predict(p, drawn, DRAWN, prior, s);
  }
  gsl_rng_free(random);
}

/* Evaluate the model for all people. Set `prior` of each person to the mean of the scales that fit
 * the displacements of the other four people best. */
static void prepare(const char *folder, bool inhaling, person *people, double *prior) {
  static const char *const names[PEOPLE] = {"054", "055", "056", "094", "097"};
  for (int pass = 0; pass < (inhaling ? 2 : 1); ++pass) {
    double total = 0;
    for (size_t k = 0; k < PEOPLE; ++k) {
      if (pass == 0) {
        load(folder, names[k], inhaling, &people[k]);
      } else {
        find_law_at_inhaled(&people[k], prior[k]);
      }
      total += fit_scale(&people[k]);
    }
    for (size_t k = 0; k < PEOPLE; ++k) {
      prior[k] = (total - fit_scale(&people[k])) / (PEOPLE - 1);
    }
  }
}

/* Time samples of the expected error, mended, against the expected errors and the positions. */
static void clock_samples(const supine_basis *basis, const supine_state *state, float *xyz,
                          float *sigma) {
  enum { REPEATS = 5 };
  static const char *const names[] = {"positions", "expected errors", "preparing samples",
                                      "a sample", "mending it"};
  const supine_doubt_task task = {.basis = basis, .state_count = 1, .states = state};
  double *space = malloc(supine_doubt_space(basis, 1) * sizeof *space);
  double *more = malloc(supine_doubt_mend_space(basis) * sizeof *more);
  double least[5] = {INFINITY, INFINITY, INFINITY, INFINITY, INFINITY};
  supine_error error;
  supine_pose pose;
  need(supine_basis_pose(basis, state, &pose, &error), &error);
  for (size_t k = 0; k < REPEATS; ++k) {
    const supine_doubt *doubt = NULL;
    const supine_doubt_mend *mend = NULL;
    double at[6] = {supine_clock_seconds()};
    supine_deform(basis, &pose, xyz);
    at[1] = supine_clock_seconds();
    need(supine_expected_error(basis, state, NULL, sigma, &error), &error);
    at[2] = supine_clock_seconds();
    need(supine_doubt_prepare(&task, space, &doubt, &error), &error);
    need(supine_doubt_mend_prepare(doubt, 0, more, &mend, &error), &error);
    at[3] = supine_clock_seconds();
    need(supine_doubt_sample(doubt, 0, 1, k, xyz, &error), &error);
    at[4] = supine_clock_seconds();
    need(supine_doubt_mend_sample(mend, xyz, &error), &error);
    at[5] = supine_clock_seconds();
    for (size_t i = 0; i < 5; ++i) {
      least[i] = fmin(least[i], at[i + 1] - at[i]);
    }
  }
  for (size_t i = 0; i < 5; ++i) {
    (void)printf("%s: %.2f ms, %.1f times the expected errors\n", names[i], 1e3 * least[i],
                 least[i] / least[1]);
  }
  free(space);
  free(more);
}

/* Open the basis of a fixture, and free the fixture. Return the bytes of the file, which the caller
 * frees after the basis. */
static unsigned char *open_fixture(fixture *f, supine_basis **basis) {
  size_t size = 0;
  supine_error error;
  unsigned char *bytes = fixture_bytes(f, &size);
  fixture_destroy(f);
  need(supine_basis_open_memory(bytes, size, basis, &error), &error);
  return bytes;
}

/* Time the covariances of points inside lungs whose law was fitted to landmarks, against preparing
 * the field. */
static void clock_covariance(void) {
  enum { VERTICES = 6000, LANDMARKS = 150, POINTS = 300, REPEATS = 5 };
  static float landmarks[4 * LANDMARKS];
  static float share[VERTICES];
  static supine_doubt_point points[POINTS];
  static double covariance[9 * POINTS * POINTS];
  fixture *f = fixture_create_shrinking(VERTICES, 16, 5);
  for (size_t i = 0; i < VERTICES; ++i) {
    share[i] = 1;
  }
  for (size_t i = 0; i < LANDMARKS; ++i) {
    const size_t vertex = i * (VERTICES / LANDMARKS);
    memcpy(landmarks + 4 * i, f->vertex + 3 * vertex, 3 * sizeof *landmarks);
    landmarks[4 * i + 3] = (float)f->lung[vertex];
  }
  for (size_t i = 0; i < POINTS; ++i) {
    points[i].vertex = i * (VERTICES / POINTS);
  }
  f->resting = fixture_resting;
  f->error_share = share;
  f->landmarks = landmarks;
  f->landmark_count = LANDMARKS;
  supine_basis *basis = NULL;
  supine_error error;
  unsigned char *bytes = open_fixture(f, &basis);
  const supine_state state = {.gravity = {1, 0, 0}, .volume = {SUPINE_VOLUME_REST, 300}};
  const supine_doubt_task task = {.basis = basis, .state_count = 1, .states = &state};
  double *space = malloc(supine_doubt_space(basis, 1) * sizeof *space);
  double least[2] = {INFINITY, INFINITY};
  for (int k = 0; k < REPEATS; ++k) {
    const supine_doubt *doubt = NULL;
    const double begin = supine_clock_seconds();
    need(supine_doubt_prepare(&task, space, &doubt, &error), &error);
    const double middle = supine_clock_seconds();
    need(supine_doubt_covariance(doubt, POINTS, points, NULL, covariance, &error), &error);
    least[0] = fmin(least[0], middle - begin);
    least[1] = fmin(least[1], supine_clock_seconds() - middle);
  }
  (void)printf("covariance of %d points given %d landmarks: %.1f ms, %.1f times the preparation\n",
               POINTS, LANDMARKS, 1e3 * least[1], least[1] / least[0]);
  free(space);
  supine_basis_close(basis);
  free(bytes);
}

static void clock_library(void) {
  enum { VERTICES = 25000, MODES = 16, SEEN = 20, REPEATS = 30 };
  static float truth[3 * VERTICES];
  static float xyz[3 * VERTICES];
  static float sigma[VERTICES];
  fixture *f = fixture_create_shrinking(VERTICES, MODES, 5);
  f->resting = fixture_resting;
  supine_basis *basis = NULL;
  supine_error error;
  unsigned char *bytes = open_fixture(f, &basis);
  supine_state state = {.gravity = {1, 0, 0}, .volume = {SUPINE_VOLUME_REST, 300}};
  supine_pose pose;
  need(supine_basis_pose(basis, &state, &pose, &error), &error);
  supine_deform(basis, &pose, truth);
  supine_observation seen[SEEN];
  for (size_t j = 0; j < SEEN; ++j) {
    const size_t at = j * (VERTICES / SEEN);
    seen[j] = (supine_observation){.vertex = at, .noise = 2};
    for (size_t i = 0; i < 3; ++i) {
      seen[j].position[i] = (double)truth[3 * at + i] + 3.0 * (double)((7 * j + 5 * i) % 11) / 11;
    }
  }
  state.volume = (supine_volume){SUPINE_VOLUME_DEFAULT, 0};
  double *space = malloc(supine_locate_space(SEEN) * sizeof *space);
  for (int rigid = 0; rigid < 2; ++rigid) {
    const supine_locate_task task = {
        .inside = basis, .count = SEEN, .observed = seen, .state = state, .rigid = rigid == 1};
    double least = INFINITY;
    double found_in = INFINITY;
    for (int k = 0; k < REPEATS; ++k) {
      supine_locate_residual residuals[SEEN];
      const supine_location *found = NULL;
      const double begin = supine_clock_seconds();
      need(supine_locate(&task, residuals, space, &found, &error), &error);
      const double middle = supine_clock_seconds();
      need(supine_locate_positions(found, basis, xyz, sigma, &error), &error);
      least = fmin(least, supine_clock_seconds() - begin);
      found_in = fmin(found_in, middle - begin);
    }
    (void)printf(
        "%d observed points, %d vertices with expected errors%s: %.2f ms, of which the fit takes "
        "%.2f ms (fastest of %d runs)\n",
        SEEN, VERTICES, rigid == 1 ? ", unknown rotation" : "", 1e3 * least, 1e3 * found_in,
        REPEATS);
  }
  free(space);
  clock_samples(basis, &state, xyz, sigma);
  supine_basis_close(basis);
  free(bytes);
}

int main(int argc, char **argv) {
  static person people[PEOPLE];
  double prior[PEOPLE];
  const char *folder = argc > 1 ? argv[1] : SUPINE_TEST_DATA "/landmarks";
  (void)printf(
      "displacement law with kriging from %d observed landmarks, chosen %d times per person; RMS "
      "errors at the other landmarks, mean over %d people\n"
      "chosen   motion               error, mm  predicted, mm  within 95 %% band  judged "
      "outliers\n",
      DRAWN, DRAWS, PEOPLE);
  for (int central = 0; central < 2; ++central) {
    double mean[4] = {0};
    for (int back = 0; back < 2; ++back) {
      double of[4] = {0};
      prepare(folder, back == 0, people, prior);
      for (size_t k = 0; k < PEOPLE; ++k) {
        sums s = {0};
        study(people, k, prior[k], central == 1, &s);
        const double own[4] = {sqrt(s.error / s.points), sqrt(s.variance / s.points),
                               100 * s.inside_band / s.points, 100 * s.left_out / s.observed};
        for (int i = 0; i < 4; ++i) {
          of[i] += own[i] / PEOPLE;
          mean[i] += own[i] / (2 * PEOPLE);
        }
      }
      (void)printf("%-7s  %s      %5.2f          %5.2f           %5.1f %%          %5.1f %%\n",
                   central == 1 ? "central" : "random",
                   back == 0 ? "exhaled to inhaled" : "inhaled to exhaled", of[0], of[1], of[2],
                   of[3]);
    }
    (void)printf("%-7s  %-18s      %5.2f          %5.2f           %5.1f %%          %5.1f %%\n",
                 central == 1 ? "central" : "random", "both", mean[0], mean[1], mean[2], mean[3]);
  }
  clock_library();
  clock_covariance();
  return EXIT_SUCCESS;
}
