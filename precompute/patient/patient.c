/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A patient's law, evaluated. */
#include <math.h>

#include "precompute/patient/patient.h"

const char *const supine_patient_law_names[SUPINE_PATIENT_LAW_COUNT + 1] = {"paper", "affine",
                                                                            "quadratic", NULL};

/* How far a lung goes on beyond the landmarks in it, mm: on ten pairs of images the outermost are
 * 5 to 15 mm inside. */
static const double landmark_margin = 10.0;

supine_patient_place supine_patient_find(const supine_patient_frame *frame, const double point[3]) {
  supine_patient_place place;
  place.side = frame->only_side != 0 ? frame->only_side : point[0] > frame->midline ? 1.0 : -1.0;
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

void supine_patient_terms(const double box[3], double terms[SUPINE_PATIENT_TERMS],
                          double (*slopes)[SUPINE_PATIENT_TERMS]) {
  double t[3]; /* -1 to 1 */
  for (int k = 0; k < 3; ++k) {
    t[k] = 2.0 * box[k] - 1.0;
  }
  const double values[SUPINE_PATIENT_TERMS] = {1.0,         t[0],        t[1],        t[2],
                                               t[0] * t[0], t[1] * t[1], t[2] * t[2], t[0] * t[1],
                                               t[0] * t[2], t[1] * t[2]};
  for (int j = 0; j < SUPINE_PATIENT_TERMS; ++j) {
    terms[j] = values[j];
  }
  if (slopes != NULL) {
    const double by[3][SUPINE_PATIENT_TERMS] = {
        {0, 2, 0, 0, 4 * t[0], 0, 0, 2 * t[1], 2 * t[2], 0},
        {0, 0, 2, 0, 0, 4 * t[1], 0, 2 * t[0], 0, 2 * t[2]},
        {0, 0, 0, 2, 0, 0, 4 * t[2], 0, 2 * t[0], 2 * t[1]}};
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < SUPINE_PATIENT_TERMS; ++j) {
        slopes[k][j] = by[k][j];
      }
    }
  }
}

/* Inside the box, and how far outside of it. */
static void clamp(const double box[3], double inside[3], double beyond[3]) {
  for (int k = 0; k < 3; ++k) {
    inside[k] = fmin(1.0, fmax(0.0, box[k]));
    beyond[k] = box[k] - inside[k];
  }
}

void supine_patient_paper_direction(const supine_patient *patient, const double point[3],
                                    double d[3]) {
  const supine_patient_place place = supine_patient_find(&patient->frame, point);
  const double *c = patient->powers;
  double box[3];
  double beyond[3];
  clamp(place.box, box, beyond);
  d[0] = place.side * patient->lengths[0] * pow(box[0], c[0]); /* (15) */
  d[1] = -patient->lengths[1] * pow(box[1], c[1]);             /* (16) */
  d[2] = -patient->lengths[2] * pow(box[2], c[2]);             /* (17) */
}

static double paper_force(const supine_patient *patient, const supine_patient_place *place) {
  const double *c = patient->powers + 3;
  double box[3];
  double beyond[3];
  clamp(place->box, box, beyond);
  return 1.0 + c[0] * (box[0] - 0.5) + c[1] * (box[1] - 0.5) + c[2] * (box[2] - 0.5); /* (18) */
}

static void polynomial(const supine_patient *patient, const supine_patient_place *place,
                       double u[3]) {
  double box[3];
  double beyond[3];
  double terms[SUPINE_PATIENT_TERMS];
  double slopes[3][SUPINE_PATIENT_TERMS];
  clamp(place->box, box, beyond);
  supine_patient_terms(box, terms, slopes);
  for (int a = 0; a < 3; ++a) {
    const double *shared = patient->polynomial + 2 * a * SUPINE_PATIENT_TERMS;
    const double *by_lung = shared + SUPINE_PATIENT_TERMS;
    u[a] = 0.0;
    for (int j = 0; j < SUPINE_PATIENT_TERMS; ++j) {
      const double term =
          terms[j] + slopes[0][j] * beyond[0] + slopes[1][j] * beyond[1] + slopes[2][j] * beyond[2];
      u[a] += (shared[j] + place->side * by_lung[j]) * term;
    }
    u[a] *= a == 0 ? place->side : 1.0;
  }
}

void supine_patient_motion(const supine_patient *patient, const double point[3], double u[3]) {
  const double *t = patient->motion;
  const double *w = patient->motion + 3;
  const supine_patient_place place = supine_patient_find(&patient->frame, point);
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3;
    const int c = (a + 2) % 3;
    u[a] = t[a] + w[b] * place.arm[c] - w[c] * place.arm[b];
  }
}

void supine_patient_displacement(const supine_patient *patient, const double point[3],
                                 double u[3]) {
  const supine_patient_place place = supine_patient_find(&patient->frame, point);
  if (patient->law == SUPINE_PATIENT_PAPER) {
    const double force = paper_force(patient, &place);
    supine_patient_paper_direction(patient, point, u);
    for (int a = 0; a < 3; ++a) {
      u[a] *= force;
    }
    return;
  }
  double motion[3];
  polynomial(patient, &place, u);
  supine_patient_motion(patient, point, motion);
  for (int a = 0; a < 3; ++a) {
    u[a] -= motion[a];
  }
}
