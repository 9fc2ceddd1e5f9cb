/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Evaluate a patient's displacement law. */
#include <math.h>
#include <string.h>

#include "precompute/patient/patient.h"

#include "base/arena.h"
#include "base/clones.h"
#include "base/vec3.h"
#include "precompute/physics/model.h"
#include "runtime/kriging.h"

#define NAME(id, name) name,
const char *const supine_patient_law_names[SUPINE_PATIENT_LAW_COUNT + 1] = {
    SUPINE_PATIENT_LAWS(NAME) NULL};

/* Distance by which a lung extends beyond its outermost landmarks, mm: 5 to 15 in ten patients. */
static const double landmark_margin = 10.0;

static double clamp_to_box(double box) {
  return fmin(1.0, fmax(0.0, box));
}

/* Return the side of a point: that of the only lung, the given one, or the side of the midline. */
static int choose_side(const supine_patient_frame *frame, const double point[3], int side) {
  if (frame->only_side != 0) {
    return frame->only_side;
  }
  if (side != 0) {
    return side;
  }
  return point[0] > frame->midline ? 1 : -1;
}

supine_patient_place supine_patient_find(const supine_patient_frame *frame, const double point[3],
                                         int side) {
  supine_patient_place place = {.force = {1.0}};
  place.side = choose_side(frame, point, side);
  const double outer = place.side > 0 ? frame->maximum[0] : frame->minimum[0];
  for (int k = 0; k < 3; ++k) {
    place.box[k] = k == 0
                       ? (point[0] - frame->midline) / (outer - frame->midline)
                       : (frame->maximum[k] - point[k]) / (frame->maximum[k] - frame->minimum[k]);
    place.offset[k] = point[k] - 0.5 * (frame->minimum[k] + frame->maximum[k]);
    place.force[1 + k] = clamp_to_box(place.box[k]) - 0.5;
  }
  return place;
}

/* Find the plane between the lungs: the middle of the widest gap between the x of points, in the
 * middle 40 % of the box. The middle of the box itself can lie in a lung, whose points would then
 * count as points of the other one. */
static double find_midline(size_t count, const double *points, double low, double high) {
  const double ends[2] = {0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high};
  double midline = 0.5 * (low + high);
  double widest = 0.0;
  for (size_t i = 0; i < count; ++i) {
    const double from = fmax(ends[0], points[3 * i]);
    double to = ends[1];
    for (size_t j = 0; j < count; ++j) {
      to = points[3 * j] > points[3 * i] ? fmin(to, points[3 * j]) : to;
    }
    if (to - from > widest) {
      widest = to - from;
      midline = 0.5 * (from + to);
    }
  }
  return midline;
}

supine_patient_frame supine_patient_frame_of_points(size_t count, const double *points,
                                                    const double *midline) {
  supine_patient_frame frame = {
      {INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, 0.0, 0};
  for (size_t i = 0; i < 3 * count; ++i) {
    frame.minimum[i % 3] = fmin(frame.minimum[i % 3], points[i] - landmark_margin);
    frame.maximum[i % 3] = fmax(frame.maximum[i % 3], points[i] + landmark_margin);
  }
  frame.midline =
      midline != NULL ? *midline : find_midline(count, points, frame.minimum[0], frame.maximum[0]);
  return frame;
}

supine_patient_frame supine_patient_frame_of_lungs(const supine_lungs *lungs) {
  supine_patient_frame frame = {.midline = lungs->midline,
                                .only_side = lungs->lung_count == 1 ? lungs->side[0] : 0};
  memcpy(frame.minimum, lungs->minimum, sizeof frame.minimum);
  memcpy(frame.maximum, lungs->maximum, sizeof frame.maximum);
  return frame;
}

int supine_patient_side_of(const supine_lungs *lungs, size_t vertex) {
  return lungs->side[lungs->lung_count == 2 && vertex >= lungs->lung_begin[1] ? 1 : 0];
}

supine_patient_place supine_patient_find_vertex(const supine_lungs *lungs, size_t vertex) {
  const supine_patient_frame frame = supine_patient_frame_of_lungs(lungs);
  return supine_patient_find(&frame, lungs->mesh.vertices + 3 * vertex,
                             supine_patient_side_of(lungs, vertex));
}

supine_patient_power supine_patient_deep(const double gravity[3], const double path_span[3]) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  const supine_model model = supine_physics_model(SUPINE_LAW_DEEP);
  supine_patient_power law = {.motion = {0.0}};
  const double *g = supine_length(gravity) > 0.0 ? gravity : supine;
  for (size_t k = 0; k < 3; ++k) {
    law.c[2 * k] = model.direction.c[2 * k] * (supine_length(path_span) > 0.0 ? path_span[k] : 1.0);
    law.c[2 * k + 1] = model.direction.c[2 * k + 1];
    /* X in the bounding box grows along x, but Y and Z along -y and -z, so their gain is
     * subtracted. */
    law.c[6 + k] = model.force.box[k] - (k > 0 ? model.force.gain * g[k] : 0.0);
  }
  return law;
}

double supine_patient_force_at(const supine_patient_power *power,
                               const supine_patient_place *place) {
  return place->force[0] + supine_dot(power->c + 6, place->force + 1); /* [Santhanam2008] (18) */
}

void supine_patient_direction(const supine_patient_power *power, const supine_patient_place *place,
                              double force, double d[3]) {
  for (int k = 0; k < 3; ++k) { /* direction of displacement, [Santhanam2008] (15)-(17) */
    d[k] = force * (k == 0 ? place->side : -1.0) * power->c[2 * k] *
           pow(clamp_to_box(place->box[k]), power->c[2 * k + 1]);
  }
}

void supine_patient_motion(const supine_patient_power *power, const supine_patient_place *place,
                           double u[3]) {
  supine_cross(power->motion + 3, place->offset, u);
  for (int k = 0; k < 3; ++k) {
    u[k] += power->motion[k];
  }
}

SUPINE_CLONES void supine_patient_covariances(const supine_patient_centre *here, size_t count,
                                              const supine_patient_centre *centre,
                                              double *covariance) {
  const supine_kriging_model model = supine_kriging_default;
  for (size_t i = 0; i < count; ++i) {
    covariance[i] = supine_kriging_covariance(&model, here->offset, here->size, centre[i].offset,
                                              centre[i].size, here->side == centre[i].side);
  }
}

void supine_patient_displacement(const supine_patient *patient, const supine_patient_place *place,
                                 double force_factor, double u[3]) {
  const supine_patient_power *power = &patient->power;
  double covariance[SUPINE_PATIENT_CENTRES_MAX];
  supine_patient_direction(power, place, force_factor * supine_patient_force_at(power, place), u);
  supine_patient_centre here = {.side = place->side, .size = supine_length(u)};
  memcpy(here.offset, place->offset, sizeof here.offset);
  supine_patient_covariances(&here, patient->centre_count, patient->centre, covariance);
  for (size_t i = 0; i < patient->centre_count; ++i) {
    for (int k = 0; k < 3; ++k) {
      u[k] += covariance[i] * patient->centre[i].weight[k];
    }
  }
}

void supine_patient_find_in_fuller(const supine_patient *patient, const double point[3], int side,
                                   double force_factor, double at[3], double u[3]) {
  enum { STEPS = 60 };
  static const double converged = 1e-4; /* change below which the iteration ends, mm */
  double change = INFINITY;
  for (int step = 0; step < STEPS && change >= converged; ++step) {
    const supine_patient_place place = supine_patient_find(&patient->frame, at, side);
    double motion[3];
    supine_patient_displacement(patient, &place, force_factor, u);
    supine_patient_motion(&patient->power, &place, motion);
    change = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      const double before = at[k];
      at[k] = point[k] - u[k] - motion[k];
      change += fabs(at[k] - before);
    }
  }
}

void supine_patient_move_to_emptier(const supine_patient *patient, int side, double point[3]) {
  const supine_patient_place place = supine_patient_find(&patient->frame, point, side);
  double u[3];
  double motion[3];
  supine_patient_displacement(patient, &place, 1.0, u);
  supine_patient_motion(&patient->power, &place, motion);
  for (size_t k = 0; k < 3; ++k) {
    point[k] += u[k] + motion[k];
  }
}

void supine_patient_points_to_fuller(const supine_patient *patient, size_t count, double *points) {
  for (size_t i = 0; i < count; ++i) {
    double u[3];
    const double point[3] = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
    supine_patient_find_in_fuller(patient, point, 0.0, 1.0, points + 3 * i, u);
  }
}

supine_force_law supine_patient_force(const supine_patient_power *power, double gain,
                                      const double gravity[3]) {
  supine_force_law law = {.gain = gain, .pair = true};
  const double *slope = power->c + 6;
  /* Gravity does not change the force's slope along X, which grows from the midline outwards: in a
   * person lying on the side, X points downwards in one lung and upwards in the other. */
  law.box[0] = slope[0];
  law.box[1] = slope[1] + gain * gravity[1];
  law.box[2] = slope[2] + gain * gravity[2];
  law.base = 1.0 - 0.5 * gain - 0.5 * (law.box[0] + law.box[1] + law.box[2]);
  return law;
}

supine_status supine_patient_shares(const supine_patient *patient, size_t count,
                                    const double *offsets, const int *sides, double *shares,
                                    supine_error *error) {
  const size_t n = patient->landmark_count;
  SUPINE_ARENA arena = {0};
  supine_kriging_point *seen = supine_arena_take(&arena, n, sizeof *seen);
  double *space = supine_arena_take(&arena, supine_kriging_space(n), sizeof *space);
  double *scratch = supine_arena_take(&arena, n, sizeof *scratch);
  supine_kriging fit;
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu landmarks", n));
  for (size_t i = 0; i < n; ++i) {
    const supine_patient_landmark *landmark = &patient->landmark[i];
    seen[i] = supine_kriging_landmark(landmark->offset, landmark->side > 0 ? 0 : 1);
  }
  SUPINE_TRY(supine_kriging_fit_landmarks(n, seen, space, &fit, error));
  for (size_t i = 0; i < count; ++i) {
    const supine_kriging_point at = supine_kriging_landmark(offsets + 3 * i, sides[i] > 0 ? 0 : 1);
    shares[i] = supine_kriging_share(&fit, &at, scratch);
  }
  return SUPINE_OK;
}
