/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Evaluate a patient's law. */
#include <math.h>

#include "precompute/patient/krige.h"
#include "precompute/patient/patient.h"
#include "sh/base/vec3.h"

const char *const supine_patient_law_names[SUPINE_PATIENT_LAW_COUNT + 1] = {"deep", "paper", NULL};

/* Distance that a lung extends beyond its landmarks, mm: in ten pairs of images the outermost
 * landmarks are 5 to 15 mm inside. */
static const double landmark_margin = 10.0;

supine_patient_place supine_patient_find(const supine_patient_frame *frame, const double point[3],
                                         double side) {
  supine_patient_place place;
  place.side = frame->only_side != 0       ? frame->only_side
               : side != 0.0               ? side
               : point[0] > frame->midline ? 1.0
                                           : -1.0;
  const double outer = place.side > 0.0 ? frame->maximum[0] : frame->minimum[0];
  place.box[0] = (point[0] - frame->midline) / (outer - frame->midline);
  for (int k = 1; k < 3; ++k) {
    place.box[k] = (frame->maximum[k] - point[k]) / (frame->maximum[k] - frame->minimum[k]);
  }
  for (int k = 0; k < 3; ++k) {
    place.arm[k] = point[k] - 0.5 * (frame->minimum[k] + frame->maximum[k]);
  }
  return place;
}

supine_patient_frame supine_patient_frame_of_points(size_t count, const double *points,
                                                    const double *midline) {
  supine_patient_frame frame = {
      {INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, 0.0, 0};
  for (size_t i = 0; i < 3 * count; ++i) {
    frame.minimum[i % 3] = fmin(frame.minimum[i % 3], points[i] - landmark_margin);
    frame.maximum[i % 3] = fmax(frame.maximum[i % 3], points[i] + landmark_margin);
  }
  frame.midline = midline != NULL ? *midline : 0.5 * (frame.minimum[0] + frame.maximum[0]);
  return frame;
}

void supine_patient_constants(const supine_patient *patient, double c[SUPINE_PATIENT_CONSTANTS]) {
  for (size_t a = 0; a < 3; ++a) {
    c[2 * a] = patient->lengths[a];
    c[2 * a + 1] = patient->powers[a];
    c[6 + a] = patient->powers[3 + a];
  }
}

static double inside(double box) {
  return fmin(1.0, fmax(0.0, box));
}

double supine_patient_force_at(const supine_patient *patient, const supine_patient_place *place) {
  double force = 1.0;
  for (int k = 0; k < 3; ++k) {
    force += patient->powers[3 + k] * (inside(place->box[k]) - 0.5); /* (18) */
  }
  return force;
}

void supine_patient_direction(const supine_patient *patient, const supine_patient_place *place,
                              double d[3]) {
  for (int k = 0; k < 3; ++k) { /* (15)-(17) */
    d[k] = (k == 0 ? place->side : -1.0) * patient->lengths[k] *
           pow(inside(place->box[k]), patient->powers[k]);
  }
}

void supine_patient_law_displacement(const supine_patient *patient,
                                     const supine_patient_place *place, double u[3]) {
  const double force = supine_patient_force_at(patient, place);
  supine_patient_direction(patient, place, u);
  for (int k = 0; k < 3; ++k) {
    u[k] *= force;
  }
}

void supine_patient_correct(const supine_patient *patient, const supine_patient_place *place,
                            const double u[3], double r[3]) {
  const supine_patient_correction *correction = &patient->correction;
  const supine_patient_frame *frame = &patient->frame;
  supine_patient_centre here = {.side = place->side, .size = supine_length(u)};
  r[0] = r[1] = r[2] = 0.0;
  for (int k = 0; k < 3; ++k) {
    here.at[k] = place->arm[k] + 0.5 * (frame->minimum[k] + frame->maximum[k]);
  }
  for (size_t i = 0; i < correction->count; ++i) {
    const supine_patient_centre *centre = &correction->centre[i];
    const double covariance = supine_patient_krige_covariance(&here, centre);
    for (int k = 0; k < 3; ++k) {
      r[k] += covariance * centre->weight[k];
    }
  }
}

void supine_patient_displacement(const supine_patient *patient, const double point[3], double side,
                                 double u[3]) {
  const supine_patient_place place = supine_patient_find(&patient->frame, point, side);
  double r[3];
  supine_patient_law_displacement(patient, &place, u);
  supine_patient_correct(patient, &place, u, r);
  for (int k = 0; k < 3; ++k) {
    u[k] += r[k];
  }
}

void supine_patient_motion(const supine_patient *patient, const double point[3], double u[3]) {
  const double *t = patient->motion;
  const double *w = patient->motion + 3;
  const supine_patient_place place = supine_patient_find(&patient->frame, point, 0.0);
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3;
    const int c = (a + 2) % 3;
    u[a] = t[a] + w[b] * place.arm[c] - w[c] * place.arm[b];
  }
}
