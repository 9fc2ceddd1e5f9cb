/* SPDX-License-Identifier: MIT */
/* From observed points, find the volume of the lungs, the rigid motion to the frame of the points,
 * and a correction of the predicted positions. */
#include <math.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/number.h"
#include "base/remedy.h"
#include "base/vec3.h"
#include "runtime/expected.h"
#include "runtime/location.h"
#include "runtime/lung.h"
#include "runtime/rigid.h"
#include "runtime/sight.h"
#include "runtime/simulated.h"

_Static_assert((int)SUPINE_LOCATE_POINTS_MAX == (int)SUPINE_KRIGING_POINTS_MAX,
               "locate.h and kriging.h must allow the same number of points");

/* Prior standard deviation of an unknown volume, divided by the reference volume (assumed): about
 * 0.3 times the difference between the volumes at full inflation and at rest. */
static const double prior_spread = 0.17;
static const double outlier_limit = 3.0; /* outliers exceed this number of standard deviations */
static const double outlier_noise = 300; /* standard deviation assigned to an outlier, mm */
static const double volume_step = 1;     /* the search ends when steps are smaller than this, mL */
static const double angle_step = 1e-4;   /* the search ends when steps are smaller than this, rad */
/* Prior standard deviation of a rotation, rad (3 degrees). If the points are turned by more than
 * 10 times this angle, their frame is another one, and nothing is assumed about the rotation. */
static const double rotation_spread = 0.052, other_frame = 0.52;
/* Points whose residuals exceed this, mm RMS, are not of these lungs: the law alone misses the
 * landmarks of ten people's full breaths by 6 to 19 mm. */
static const double residual_most = 40;
static const double share_least = 0.1; /* share of full inflation without gas (resting.c) */
/* If the spread of the observed points is below this share of their spread in the scan, they are at
 * one place. */
static const double spread_least = 0.05;
/* The factor on the expected errors counts as 1 for this number of points before (assumed). */
static const double prior_points = 10;
/* The factor multiplies nothing where the law does not move the lungs, as at the volume of the
 * scan. Variance of the residuals beyond this multiple of the expected one, without the noise, is
 * therefore added to the errors. With right volumes, it is hardly ever reached (docs/inputs.md). */
static const double excess_from = 1.5;
/* Ratio of supine_kriging_model.sill, 6 mm, to the factor c of the expected error in
 * supine/locate.h, 4.5 mm. Both are variances (mm^2) per mm of displacement. c is smaller because
 * the translation that fits best had been subtracted before c was measured. */
static const double sill_of_error = 4.0 / 3;

/* Largest number of Gauss-Newton steps, and of times that a step of the volume is halved. */
enum { STEPS_MAX = 20, HALVINGS_MAX = 8, ROUGH_STEPS = 30 };

typedef struct workspace {
  const supine_locate_task *task;
  supine_location_info *found; /* &fit->info */
  supine_location *fit;
  supine_kriging_point *points; /* [task->count] observed points */
  double *law;                  /* [task->count, 3] predicted positions before correction, mm */
  double *kriging; /* [supine_kriging_space(task->count)] work space of supine_kriging_fit */
  double
      *scratch; /* [supine_kriging_scratch(task->count)] work space of supine_kriging_leave_out */
  double *seen; /* [task->count, 3] observed positions; on a line, near the prediction, mm */
} workspace;

size_t supine_locate_space(size_t count) {
  return supine_space_doubles(sizeof(supine_location)) +
         supine_space_doubles(count * sizeof(supine_kriging_point)) + 6 * count +
         supine_kriging_scratch(count) + supine_kriging_space(count);
}

static void place_in(double *space, size_t count, workspace *s) {
  s->fit = (supine_location *)space;
  s->found = &s->fit->info;
  space += supine_space_doubles(sizeof *s->fit);
  s->points = (supine_kriging_point *)space;
  space += supine_space_doubles(count * sizeof *s->points);
  s->law = space;
  s->seen = space + 3 * count;
  s->kriging = space + 6 * count;
  s->scratch = s->kriging + supine_kriging_space(count);
}

static supine_status check(const supine_locate_task *task, supine_error *error) {
  const size_t n = supine_basis_get_info(task->inside)->vertex_count;
  if (task->count == 0 || task->count > SUPINE_LOCATE_POINTS_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "%zu observed points: give 1 to %d",
                            task->count, (int)SUPINE_LOCATE_POINTS_MAX);
  }
  if (!(task->depth >= 0 && isfinite(task->depth))) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "depth %g mm: give a number above 0",
                            task->depth);
  }
  for (size_t j = 0; j < task->count; ++j) {
    const supine_observation *o = &task->observed[j];
    if (o->vertex >= n || !supine_sight_valid(o) || !(o->noise > 0) || !isfinite(o->noise)) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "observation %zu has vertex %zu: give a vertex below %zu, a finite "
                              "position, a noise above 0, and for a line two finite positions that "
                              "differ",
                              j + 1, o->vertex, n);
    }
  }
  const size_t different = supine_sight_count(task->count, task->observed);
  if (task->rigid && different < 3) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a rotation needs three observed points, not %zu", different);
  }
  return SUPINE_OK;
}

static void position(const supine_basis *basis, const supine_pose *pose, size_t vertex,
                     double at[3]) {
  float x[3];
  (void)supine_deform_range(basis, pose, vertex, vertex + 1, x);
  for (size_t i = 0; i < 3; ++i) {
    at[i] = (double)x[i];
  }
}

/* Return the volume, of the kind that the prior counts from, at which the search for an unknown
 * volume begins. Fields over gravity and volume begin in the middle of the simulated range, from
 * where they can be followed both ways. */
static supine_volume begin_volume(const supine_basis *basis, const double gravity[3]) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double limits[SUPINE_LUNGS_MAX][2];
  supine_volume volume = {SUPINE_VOLUME_SCAN, 0};
  if (info->has_rest) {
    volume.kind = SUPINE_VOLUME_REST;
  } else if (info->order > 0 && supine_simulated_limits(basis, gravity, limits) == SUPINE_OK) {
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      volume.ml += 0.5 * (limits[lung][0] + limits[lung][1]);
    }
  }
  return volume;
}

/* Set all parts of the workspace that do not depend on the state: the position in the scan, the
 * lung and the noise of each point, and the options of the fit. */
static supine_status initialise(workspace *s, supine_error *error) {
  const supine_locate_task *task = s->task;
  const supine_basis *basis = task->inside;
  const supine_basis_info *info = supine_basis_get_info(basis);
  const bool variable = info->has_volume && (!info->is_fields || info->order > 0);
  const bool unknown =
      task->state.lung_count == 0 && variable && task->state.volume.kind == SUPINE_VOLUME_DEFAULT;
  supine_pose pose;
  supine_status status = SUPINE_OK;
  if (variable && !unknown) { /* a given volume is judged */
    status = supine_basis_pose(basis, &task->state, &pose, error);
  }
  if (status == SUPINE_OK) {
    status = supine_basis_scan_pose(basis, &pose, error);
  }
  if (status == SUPINE_OK) {
    for (size_t j = 0; j < task->count; ++j) {
      supine_kriging_point *p = &s->points[j];
      *p = (supine_kriging_point){.lung = supine_basis_lung_of(info, task->observed[j].vertex),
                                  .noise = task->observed[j].noise,
                                  .on_line = task->observed[j].on_line};
      position(basis, &pose, task->observed[j].vertex, p->position);
    }
  }
  *s->fit = (supine_location){
      .info = {.state = task->state, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}},
      .options = {.model = supine_kriging_default, .volume = unknown, .rotation = task->rigid},
      .deviation = unknown ? prior_spread * supine_expected_reference(basis) : 0};
  if (supine_sight_unseen(task->count, task->observed, s->fit->axis)) {
    s->fit->options.axis_deviation = task->depth > 0 ? task->depth : SUPINE_LOCATE_DEPTH_MM;
  }
  if (unknown) {
    s->found->state.volume = begin_volume(basis, task->state.gravity);
  }
  s->fit->options.model.sill = sill_of_error * supine_expected_constant(basis);
  return status;
}

static void rotate(const double rotation[9], const double x[3], double rotated[3]) {
  for (size_t i = 0; i < 3; ++i) {
    rotated[i] = rotation[3 * i] * x[0] + rotation[3 * i + 1] * x[1] + rotation[3 * i + 2] * x[2];
  }
}

/* For each observed point, compute the predicted position in the current state, the length of its
 * displacement from the scan, and its shift if the volume grows by one prior standard deviation. */
static supine_status evaluate(workspace *s, supine_error *error) {
  const supine_locate_task *task = s->task;
  const double step = supine_expected_shift * supine_expected_reference(task->inside);
  supine_pose pose;
  supine_pose fuller;
  supine_status status = supine_basis_pose_any(task->inside, &s->found->state, &pose, error);
  if (status == SUPINE_OK && s->fit->options.volume) {
    status = supine_expected_shifted(task->inside, &s->found->state, &fuller, error);
  }
  if (status == SUPINE_OK) {
    for (size_t j = 0; j < task->count; ++j) {
      double *x = s->law + 3 * j;
      double other[3];
      double square = 0;
      position(task->inside, &pose, task->observed[j].vertex, x);
      if (s->fit->options.volume) {
        position(task->inside, &fuller, task->observed[j].vertex, other);
      }
      for (size_t i = 0; i < 3; ++i) {
        const double u = x[i] - s->points[j].position[i];
        square += u * u;
        s->points[j].volume[i] =
            s->fit->options.volume ? (other[i] - x[i]) * s->fit->deviation / step : 0;
      }
      s->points[j].size = sqrt(square);
    }
  }
  return status;
}

/* Rotate a vector from the frame of the observations to that of the basis. */
static void rotate_back(const double rotation[9], const double x[3], double rotated[3]) {
  for (size_t i = 0; i < 3; ++i) {
    rotated[i] = rotation[i] * x[0] + rotation[3 + i] * x[1] + rotation[6 + i] * x[2];
  }
}

/* For the current rotation, find the observed positions, and the translation from the mean
 * predicted to the mean observed position (supine_location.origin). Turn lines to the frame of the
 * basis. */
static void place_points(workspace *s) {
  const size_t n = s->task->count;
  const double *rotation = s->found->rotation;
  supine_kriging_options *options = &s->fit->options;
  double mean[3] = {0};
  double observed[3] = {0};
  double centre[3];
  for (size_t j = 0; j < n; ++j) {
    rotate(rotation, s->law + 3 * j, s->seen + 3 * j);
  }
  supine_sight_place(n, s->task->observed, s->seen, s->fit->axis, fmax(options->axis_deviation, 1),
                     s->seen);
  for (size_t j = 0; j < n; ++j) {
    for (size_t i = 0; i < 3; ++i) {
      mean[i] += s->law[3 * j + i] / (double)n;
      observed[i] += s->seen[3 * j + i] / (double)n;
    }
    if (s->points[j].on_line) {
      double direction[3];
      supine_sight_direction(&s->task->observed[j], direction);
      rotate_back(rotation, direction, s->points[j].direction);
    }
  }
  rotate(rotation, mean, centre);
  options->axis_mean = 0;
  for (size_t i = 0; i < 3; ++i) {
    s->fit->origin[i] = observed[i] - centre[i];
    options->axis_mean -= s->fit->axis[i] * (observed[i] - mean[i]);
  }
  rotate_back(rotation, s->fit->axis, options->axis);
}

/* Compute the residual of each point in the frame of the basis, for the current rotation. */
static void find_residuals(workspace *s) {
  place_points(s);
  for (size_t j = 0; j < s->task->count; ++j) {
    double d[3];
    supine_subtract(s->seen + 3 * j, s->fit->origin, d);
    rotate_back(s->found->rotation, d, s->points[j].residual);
    supine_subtract(s->points[j].residual, s->law + 3 * j, s->points[j].residual);
  }
}

/* Return the angle of a rotation matrix, rad. Write its rotation vector. */
static double angle_of(const double r[9], double vector[3]) {
  const double angle = acos(fmax(-1, fmin(1, 0.5 * (r[0] + r[4] + r[8] - 1))));
  const double factor = angle < 1e-9 ? 0.5 : 0.5 * angle / fmax(1e-9, sin(angle));
  vector[0] = factor * (r[7] - r[5]);
  vector[1] = factor * (r[2] - r[6]);
  vector[2] = factor * (r[3] - r[1]);
  return angle;
}

/* Find the rigid motion that moves the predicted positions closest to the observed ones. */
static supine_rigid_motion find_motion(const workspace *s) {
  supine_rigid_motion motion = {0};
  for (size_t j = 0; j < s->task->count; ++j) {
    float law[3];
    float observed[3];
    for (size_t i = 0; i < 3; ++i) {
      law[i] = (float)s->law[3 * j + i];
      observed[i] = (float)s->seen[3 * j + i];
    }
    supine_rigid_add(&motion, law, observed, 1);
  }
  supine_rigid_finish(&motion);
  return motion;
}

/* Measure the turn of the points that fits best, where no rotation is to be found. It is 0 if the
 * points do not fit clearly better with it: the residuals must fall to a quarter. */
static void find_turn(workspace *s) {
  const size_t n = s->task->count;
  const supine_rigid_motion motion = find_motion(s);
  double vector[3];
  double straight = 0;
  double turned = 0;
  for (size_t j = 0; j < n; ++j) {
    float law[3];
    for (size_t i = 0; i < 3; ++i) {
      law[i] = (float)s->law[3 * j + i];
    }
    for (size_t i = 0; i < 3; ++i) {
      const double observed = s->seen[3 * j + i];
      straight += pow(observed - (double)law[i] - motion.to[i] + motion.from[i], 2);
      turned += pow(observed - supine_rigid_move(&motion, law, i), 2);
    }
  }
  s->found->turn = n > 3 && turned < straight / 16 ? angle_of(motion.rotation, vector) : 0;
}

/* Measure how much wider, deeper and higher the points lie than the law predicts: on each axis the
 * slope b of the observed over the predicted positions x about their means, and its standard error
 *
 *     b = 1 + sum x r / sum x^2,   sqrt(sum (r - (b - 1) x)^2 / (n - 2) / sum x^2)
 *
 * where r is the residual. Outliers and points on lines do not count. */
static void find_stretch(workspace *s, const supine_locate_residual *residuals) {
  enum { POINTS_LEAST = 10 };
  double used[SUPINE_LOCATE_POINTS_MAX];
  double n = 0;
  for (size_t j = 0; j < s->task->count; ++j) {
    used[j] = residuals[j].outlier || s->points[j].on_line ? 0 : 1;
    n += used[j];
  }
  for (size_t k = 0; k < 3; ++k) {
    double x = 0; /* sums */
    double r = 0;
    double xx = 0;
    double xr = 0;
    double rr = 0;
    for (size_t j = 0; j < s->task->count; ++j) {
      const double predicted = s->law[3 * j + k] - s->law[k];
      const double residual = s->points[j].residual[k];
      x += used[j] * predicted;
      r += used[j] * residual;
      xx += used[j] * predicted * predicted;
      xr += used[j] * predicted * residual;
      rr += used[j] * residual * residual;
    }
    const double size = xx - x * x / n;
    const double slope = (xr - x * r / n) / size;
    const double left = fmax(0, rr - r * r / n - slope * slope * size);
    const bool enough = n >= POINTS_LEAST && size > 0;
    s->found->stretch[k] = enough ? 1 + slope : 1;
    s->found->stretch_error[k] = enough ? sqrt(left / (n - 2) / size) : 0;
  }
}

static bool sighted(const workspace *s) {
  for (size_t j = 0; j < s->task->count; ++j) {
    if (s->points[j].on_line) {
      return true;
    }
  }
  return false;
}

/* Set the rotation to the one that moves the predicted positions closest to the observed ones.
 * Points on lines are found again after each rotation. */
static void rotate_roughly(workspace *s) {
  const size_t steps = sighted(s) ? ROUGH_STEPS : 1;
  double vector[3];
  for (size_t step = 0; step < steps; ++step) {
    const supine_rigid_motion motion = find_motion(s);
    memcpy(s->found->rotation, motion.rotation, sizeof motion.rotation);
    place_points(s);
  }
  s->fit->options.rotation_deviation =
      angle_of(s->found->rotation, vector) > other_frame ? 0 : rotation_spread;
}

/* Replace the rotation R by the one nearest to R (1 + [r]), where [r] x = r x x, r in rad. */
static void rotate_further(double rotation[9], const double r[3]) {
  double transposed[3][3]; /* of R (1 + [r]) */
  for (size_t a = 0; a < 3; ++a) {
    const double *row = rotation + 3 * a;
    double turned[3]; /* row [r] = row x r */
    supine_cross(row, r, turned);
    for (size_t b = 0; b < 3; ++b) {
      transposed[b][a] = row[b] + turned[b];
    }
  }
  supine_rigid_rotation((const double(*)[3])transposed, rotation);
}

/* Change the volume by `ml` mL, but by at most half of the prior standard deviation of the volume.
 * Halve the change until the lungs can hold the new volume. */
static supine_status change_volume(workspace *s, double ml, supine_error *error) {
  const double most = 0.5 * s->fit->deviation;
  const double before = s->found->state.volume.ml;
  ml = fmax(-most, fmin(most, ml));
  supine_status status = SUPINE_OK;
  for (int halving = 0; halving < HALVINGS_MAX; ++halving) {
    s->found->state.volume.ml = before + ml;
    status = evaluate(s, NULL);
    if (status == SUPINE_OK) {
      return status;
    }
    ml /= 2;
  }
  (void)supine_error_set(error, status,
                         "the points need a volume that the lungs cannot hold: check their names, "
                         "unit and axes");
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_give("volume", "", "")};
  supine_error_advise(error, advice);
  return status;
}

/* Find the unknown volume and rotation by Gauss-Newton steps. */
static supine_status iterate(workspace *s, supine_error *error) {
  supine_location *fit = s->fit;
  const double deviation = fit->deviation;
  for (int step = 0;; ++step) {
    find_residuals(s);
    double vector[3];
    fit->options.volume_mean = fit->options.volume ? -s->found->state.volume.ml / deviation : 0;
    (void)angle_of(s->found->rotation, vector);
    for (size_t i = 0; i < 3; ++i) {
      fit->options.rotation_mean[i] = -vector[i];
    }
    supine_status status = supine_kriging_fit(&fit->options, s->task->count, s->points, s->kriging,
                                              &fit->kriging, error);
    if (status != SUPINE_OK) {
      return status;
    }
    const double *r = fit->kriging.terms + 4;
    const double ml = fit->kriging.terms[3] * deviation;
    const bool turned = fabs(r[0]) + fabs(r[1]) + fabs(r[2]) > angle_step;
    if (step == STEPS_MAX || (fabs(ml) < volume_step && !turned)) {
      return SUPINE_OK;
    }
    rotate_further(s->found->rotation, r);
    if (fit->options.volume) {
      status = change_volume(s, ml, error);
    }
    if (status != SUPINE_OK) {
      return status;
    }
  }
}

/* Compare an observation with its prediction by all others but `left - 1` ones. */
static supine_locate_residual compare(workspace *s, size_t left, const size_t *points) {
  const size_t j = points[0];
  const double noise = s->task->observed[j].noise;
  const double axes = s->points[j].on_line ? 2 : 3; /* along which the distance counts */
  const double extra = s->points[j].noise * s->points[j].noise - noise * noise;
  double d[3];
  const double sigma = supine_kriging_leave_out(&s->fit->kriging, left, points, d, s->scratch);
  return (supine_locate_residual){.distance = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]),
                                  .sigma = sqrt(fmax(0, sigma * sigma - axes * extra))};
}

static double ratio_of(const supine_locate_residual *r) {
  return r->sigma > 0 ? r->distance / r->sigma : 1;
}

/* List observation j and others of its vertex, at most SUPINE_KRIGING_LEFT_MAX. Return how many. */
static size_t list_views(const workspace *s, size_t j, size_t *views) {
  const supine_observation *observed = s->task->observed;
  size_t count = 1;
  views[0] = j;
  for (size_t k = 0; k < s->task->count; ++k) {
    const bool other = k != j && observed[k].vertex == observed[j].vertex;
    if (other && count < SUPINE_KRIGING_LEFT_MAX) {
      views[count++] = k;
    }
  }
  return count;
}

/* Compare each observed point with its prediction by all other points. Views of one point are left
 * out together, and count as one point; each is compared with the other views, too, to find an
 * outlier. Return the index of the worst new outlier, or the number of observations if there is
 * none. */
static size_t find_worst(workspace *s, supine_locate_residual *residuals) {
  const size_t n = s->task->count;
  size_t worst = n;
  double largest = outlier_limit;
  double sum = 0;
  double expected = 0;
  double noises = 0;
  double ratios = 0;
  double used = 0;
  for (size_t j = 0; j < n; ++j) {
    supine_locate_residual *r = &residuals[j];
    const bool outlier = r->outlier;
    size_t views[SUPINE_KRIGING_LEFT_MAX];
    const size_t count = list_views(s, j, views);
    const double share = 1 / (double)count;
    const supine_locate_residual apart = compare(s, count, views);
    const supine_locate_residual viewed = count > 1 ? compare(s, 1, views) : apart;
    const bool differs = ratio_of(&viewed) > fmax(ratio_of(&apart), outlier_limit);
    *r = differs ? viewed : apart;
    r->outlier = outlier;
    if (outlier) {
      continue;
    }
    sum += share * apart.distance * apart.distance;
    expected += share * apart.sigma * apart.sigma;
    noises += share * (s->points[j].on_line ? 2 : 3) * pow(s->task->observed[j].noise, 2);
    used += share;
    ratios += share * pow(ratio_of(&apart), 2);
    if (ratio_of(r) > largest) {
      largest = ratio_of(r);
      worst = j;
    }
  }
  s->fit->factor = sqrt((prior_points + ratios) / (prior_points + used));
  s->found->residual_rms = used > 0 ? sqrt(sum / used) : 0;
  s->found->residual_expected = used > 0 ? sqrt(expected / used) : 0;
  s->fit->excess =
      used > 0 ? fmax(0, (sum - noises - excess_from * (expected - noises)) / used) : 0;
  return worst;
}

/* Refuse observed points that are at one place, although the points in the scan are not. */
static supine_status refuse_place(const workspace *s, supine_error *error) {
  double seen = 0;
  double scanned = 0;
  for (size_t j = 0; j < 3 * s->task->count; ++j) {
    seen += pow(s->seen[j] - s->seen[j % 3], 2);
    scanned += pow(s->points[j / 3].position[j % 3] - s->points->position[j % 3], 2);
  }
  return seen >= spread_least * spread_least * scanned
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                "the observed points are at one place, unlike those in the scan: "
                                "check their positions and unit");
}

/* Refuse what no patient has: large residuals, or lungs that are nearly empty. */
static supine_status refuse_residuals(const workspace *s, const supine_locate_residual *residuals,
                                      supine_error *error) {
  const double full = supine_expected_reference(s->task->inside);
  double square = 0;
  for (size_t j = 0; j < s->task->count; ++j) {
    square += residuals[j].distance * residuals[j].distance / (double)s->task->count;
  }
  if (sqrt(square) > residual_most) {
    const double degrees = s->found->turn * (180 / 3.14159265358979);
    char turn[96] = "";
    if (supine_input_judge(SUPINE_INPUT_LOCATE_TURNED, degrees) != SUPINE_INPUT_TAKEN) {
      (void)supine_print_text(
          turn, sizeof turn,
          "; they fit much better when turned by %.0f degrees: let their frame turn", degrees);
    }
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "the points do not fit these lungs: each differs by %.0f mm (RMS) "
                            "from its prediction by the others. Check their names, unit and axes%s",
                            sqrt(square), turn);
  }
  if (s->fit->options.volume && !(s->found->volume >= share_least * full)) {
    (void)supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                           "the points fit lungs of %.0f mL, under %.0f %% of full inflation "
                           "(%.0f mL): check their names, unit and axes",
                           s->found->volume, 100 * share_least, full);
    const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_give("volume", "", "")};
    supine_error_advise(error, advice);
    return SUPINE_ERROR_NUMERICAL;
  }
  return SUPINE_OK;
}

static supine_status locate(workspace *s, supine_locate_residual *residuals, supine_error *error) {
  const size_t n = s->task->count;
  supine_status status = initialise(s, error);
  if (status == SUPINE_OK) {
    status = evaluate(s, error);
  }
  if (status == SUPINE_OK) {
    place_points(s);
    status = refuse_place(s, error);
  }
  if (status == SUPINE_OK && s->task->rigid) {
    rotate_roughly(s);
  } else if (status == SUPINE_OK) {
    find_turn(s);
  }
  while (status == SUPINE_OK) {
    status = iterate(s, error);
    if (status != SUPINE_OK) {
      break;
    }
    const size_t worst = find_worst(s, residuals);
    if (worst == n || 5 * (s->found->outlier_count + 1) > n) {
      break;
    }
    residuals[worst].outlier = true;
    s->points[worst].noise = outlier_noise;
    ++s->found->outlier_count;
  }
  return status;
}

/* Warn of the axis on which the points are farthest from the predicted size, if they are too
 * far. */
static void check_stretch(const supine_location_info *found, supine_findings *findings) {
  static const char *const sizes[] = {"width", "depth", "height"};
  size_t worst = 0;
  double most = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double stretch = found->stretch[k];
    const double off = stretch > 0 ? fabs(log(stretch)) - 2 * found->stretch_error[k] : INFINITY;
    worst = off > most ? k : worst;
    most = fmax(most, off);
  }
  if (supine_input_judge(SUPINE_INPUT_LOCATE_STRETCHED, most) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(findings,
                         "the %s of what the points show is %.2f times that of these lungs in the "
                         "fitted state: check that the points are this person's, their unit and "
                         "axes, the volume and the posture",
                         sizes[worst], found->stretch[worst]);
  }
}

void supine_location_check(const supine_location_info *found, supine_findings *findings) {
  const double expected = found->residual_expected;
  const double ratio = expected > 0 ? found->residual_rms / expected : 0;
  const double degrees = found->turn * (180 / 3.14159265358979);
  if (supine_input_judge(SUPINE_INPUT_LOCATE_TURNED, degrees) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(findings,
                         "the points fit much better when turned by %.0f degrees: let their frame "
                         "turn",
                         degrees);
  } else if (supine_input_judge(SUPINE_INPUT_LOCATE_RESIDUALS, ratio) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(findings,
                         "the points differ from their predictions by the others by %.1f mm (RMS), "
                         "where %.1f mm are expected: check the volume, the posture, and the names "
                         "of the points",
                         found->residual_rms, expected);
  } else {
    check_stretch(found, findings);
  }
}

supine_status supine_locate(const supine_locate_task *task, supine_locate_residual *residuals,
                            double *space, const supine_location **location, supine_error *error) {
  *location = NULL;
  supine_status status = check(task, error);
  if (status != SUPINE_OK) {
    return status;
  }
  const supine_basis_info *info = supine_basis_get_info(task->inside);
  workspace s = {.task = task};
  place_in(space, task->count, &s);
  supine_location_info *found = s.found;
  *location = s.fit;
  memset(residuals, 0, task->count * sizeof *residuals);
  status = locate(&s, residuals, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (info->has_volume) {
    supine_pose pose;
    double volumes[SUPINE_LUNGS_MAX];
    (void)supine_basis_pose_any(task->inside, &found->state, &pose, NULL);
    (void)supine_basis_volumes(task->inside, &pose, volumes);
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      found->volume += volumes[lung];
    }
    found->volume_error = s.fit->factor * s.fit->deviation * sqrt(s.fit->kriging.covariance[3][3]);
  }
  status = refuse_residuals(&s, residuals, error);
  if (s.fit->options.volume) {
    found->volume_prior_error = s.fit->deviation;
    found->state.volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, found->volume};
  }
  find_stretch(&s, residuals);
  rotate(found->rotation, s.fit->kriging.terms, found->translation);
  for (size_t i = 0; i < 3; ++i) {
    found->translation[i] += s.fit->origin[i];
  }
  if (s.fit->options.axis_deviation > 0) {
    double square = 0;
    for (size_t k = 0; k < 9; ++k) {
      square += s.fit->options.axis[k / 3] * s.fit->options.axis[k % 3] *
                s.fit->kriging.covariance[k / 3][k % 3];
    }
    found->depth_error = s.fit->factor * sqrt(fmax(0, square));
  }
  found->log_evidence = s.fit->kriging.log_likelihood;
  return status;
}

const supine_location_info *supine_location_get_info(const supine_location *found) {
  return &found->info;
}
