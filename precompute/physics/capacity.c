/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Estimate the volumes at full inflation and at rest, and warn of an implausible scan state.
 *
 * The total lung capacity of adults of height H in m (ECSC: Quanjer et al., Eur Respir J 6 Suppl
 * 16, 1993) is 7.99 H - 7.08 L in men (SD 0.7 L) and 6.60 H - 5.79 L in women (SD 0.6 L). This is
 * the gas volume in upright posture. The code divides it by 1 + SUPINE_FULL_UPRIGHT_GAIN to get the
 * volume in supine posture, and adds the tissue. The coefficients were checked against an R
 * implementation of the ECSC table (getQuanjerPred, getQuanjerLLN), not against the paper. For
 * usual heights (below), capacities are within 5 % of the medians of Hall et al. at age 40 (Eur
 * Respir J 57: 2000289, 2021).
 *
 * Of the volume alone nothing can be said: a child's lungs at full inflation hold what an adult's
 * do at rest. Small lungs are told only for a known height. */
#include <math.h>

#include <supine/inputs.h>

#include "base/number.h"
#include "base/remedy.h"
#include "base/text.h"
#include "precompute/physics/reference.h"

/* The state given for a scan is doubtful if it implies a larger volume of both lungs at full
 * inflation. */
static const double most_ml = 10000.0;

/* Largest accepted relative difference between the scan's volume and that given by --resting. */
static const double agreement = 0.05;

static const struct {
  supine_sex sex;
  double slope, offset; /* capacity in L is slope x height in m - offset */
  double usual[2];      /* range of an adult's height if it is unknown, cm */
  double measured[2];   /* range of the heights for which the equation is stated, cm */
} equations[] = {{SUPINE_SEX_FEMALE, 6.60, 5.79, {150.0, 180.0}, {145.0, 180.0}},
                 {SUPINE_SEX_MALE, 7.99, 7.08, {160.0, 195.0}, {155.0, 195.0}}};
enum { EQUATIONS = sizeof equations / sizeof *equations };

/* Return whether an equation is for a person; both are if the sex is unknown. */
static bool is_for(size_t equation, const supine_person *person) {
  return person->sex == SUPINE_SEX_UNKNOWN || person->sex == equations[equation].sex;
}

bool supine_physics_reference_height_is_told(const supine_person *person, double range[2]) {
  range[0] = INFINITY;
  range[1] = 0.0;
  for (size_t k = 0; k < EQUATIONS; ++k) {
    if (is_for(k, person)) {
      range[0] = fmin(range[0], equations[k].measured[0]);
      range[1] = fmax(range[1], equations[k].measured[1]);
    }
  }
  return person->height > 0.0 &&
         (supine_input_judge(SUPINE_INPUT_HEIGHT_LEAST, person->height / range[0]) !=
              SUPINE_INPUT_TAKEN ||
          supine_input_judge(SUPINE_INPUT_HEIGHT_MOST, person->height / range[1]) !=
              SUPINE_INPUT_TAKEN);
}

void supine_physics_reference_capacity(const supine_person *person, double range[2]) {
  range[0] = INFINITY;
  range[1] = 0.0;
  for (size_t k = 0; k < EQUATIONS; ++k) {
    if (!is_for(k, person)) {
      continue;
    }
    for (int end = 0; end < 2; ++end) {
      const double height = person->height > 0.0 ? person->height : equations[k].usual[end];
      const double upright =
          1e3 * fmax(0.0, equations[k].slope * 1e-2 * height - equations[k].offset);
      const double full = upright / (1.0 + SUPINE_FULL_UPRIGHT_GAIN) + SUPINE_TISSUE_ML;
      range[0] = fmin(range[0], full);
      range[1] = fmax(range[1], full);
    }
  }
}

/* Return the scanned lungs' usual share of the volume of both lungs: 1 if both were scanned. */
static double part_of_pair(const supine_reference *reference) {
  if (reference->lung_count == 2) {
    return 1.0;
  }
  return reference->side[0] > 0 ? SUPINE_LEFT_SHARE : 1.0 - SUPINE_LEFT_SHARE;
}

/* The FRC of adults upright (Hall et al. 2021, above; SD 21 % in men, 20 % in women) is
 * exp(-13.4898 + 0.1111 ln A + 2.7634 ln H) L in men of A years and H cm, exp(-12.7674 + 0.1251 ln
 * A
 * + 2.6049 ln H) L in women, times a spline of age that is left out (0.97 in men of 45 years). A is
 * 45, as the age is unknown: from 25 to 70 years, FRC changes by -7 to +6 %. */
void supine_physics_reference_predict_rest(const supine_reference *reference,
                                           const supine_person *person, supine_resting *resting) {
  static const double frc[2][2] = {{-12.2912, 2.6049}, {-13.0669, 2.7634}}; /* [0] women, [1] men */
  const double *c = frc[person->sex == SUPINE_SEX_MALE];
  if (reference->scan.state.volume.kind == SUPINE_VOLUME_FULL && person->height > 0.0 &&
      person->sex != SUPINE_SEX_UNKNOWN && !supine_physics_resting_given(resting) &&
      resting->assumed == SUPINE_REST_SHARE) {
    resting->ml[2] = part_of_pair(reference) * (1e3 * exp(c[0] + c[1] * log(person->height)) -
                                                SUPINE_LYING_ML + SUPINE_TISSUE_ML);
    resting->predicted = true;
  }
}

void supine_physics_reference_compare(const supine_reference *reference,
                                      const supine_person *person, char *text, size_t size) {
  const double part = part_of_pair(reference);
  double range[2];
  supine_physics_reference_capacity(person, range);
  const bool known = person->height > 0.0 && person->sex != SUPINE_SEX_UNKNOWN;
  supine_text_add(text, size, known ? "expected %.0f" : "an adult's %.0f to %.0f", part * range[0],
                  part * range[1]);
}

/* Warn if the scan does not hold what its state and the given volume at rest say. */
static void doubt_rest(const supine_state *state, double held, const supine_resting *given,
                       supine_findings *findings) {
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_change("scanned", ""),
                                                     supine_remedy_change("resting", "")};
  for (size_t axis = 0; axis < 6; ++axis) {
    const double along = (axis % 2 == 0 ? 1.0 : -1.0) * state->gravity[axis / 2];
    const double ml = given->ml[axis] + state->volume.ml;
    if (along > 1.0 - 1e-9 && given->ml[axis] > 0.0 && fabs(held - ml) > agreement * ml) {
      supine_findings_warn(findings,
                           "the scan holds %.0f mL, but its state and the volume at "
                           "rest say %.0f mL",
                           held, ml);
      supine_findings_advise(findings, advice);
    }
  }
}

void supine_physics_reference_doubt(const supine_reference *reference, const supine_person *person,
                                    const supine_resting *given, supine_findings *findings) {
  const supine_state *state = &reference->scan.state;
  const bool at_rest = state->volume.kind == SUPINE_VOLUME_REST;
  const double part = part_of_pair(reference);
  double range[2];
  double full = 0.0;
  double held = 0.0;
  char expected[64] = "";
  supine_physics_reference_capacity(person, range);
  supine_physics_reference_compare(reference, person, expected, sizeof expected);
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    full += reference->full_volume[lung];
    held += reference->full_volume[lung] + reference->scan_volume[lung];
  }
  if (at_rest) {
    doubt_rest(state, held, given, findings);
  }
  const double share = person->height > 0.0 ? full / (part * range[0]) : 1.0;
  if (supine_input_judge(SUPINE_INPUT_LUNGS_SMALL, share) != SUPINE_INPUT_TAKEN) {
    supine_findings_warn(
        findings, "at full inflation the lungs hold %.0f mL (%s mL): %s", full, expected,
        at_rest ? "check the voxel spacing" : "the scan was probably not at full inflation");
    const supine_remedy of_rest[SUPINE_REMEDIES_MAX] = {
        supine_remedy_change("resting", ""),
        supine_remedy_such_as("scanned", "supine:rest-300", "if the scan was emptier than rest")};
    const supine_remedy of_full[SUPINE_REMEDIES_MAX] = {
        supine_remedy_such_as("scanned", "supine:rest", "or full-1000")};
    supine_findings_advise(findings, at_rest ? of_rest : of_full);
  } else if (full > part * most_ml) {
    supine_findings_warn(
        findings, "at full inflation the lungs hold %.0f mL (%s mL)%s", full, expected,
        at_rest ? "" : ": check the voxel spacing or the unit, and that all of the mask is lung");
    const supine_remedy fuller[SUPINE_REMEDIES_MAX] = {
        supine_remedy_such_as("scanned", "supine:rest+1000", "if the scan was fuller than rest"),
        supine_remedy_change("resting", "")};
    const supine_remedy none[SUPINE_REMEDIES_MAX] = {{.kind = SUPINE_REMEDY_NONE}};
    supine_findings_advise(findings, at_rest ? fuller : none);
  }
}
