/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Volume of a person's lungs at full inflation, and warnings where a scan's stated state is
 * implausible. Total lung capacity of adults by height H in m (ECSC: Quanjer et al., Eur Respir J 6
 * Suppl 16, 1993): men 7.99 H - 7.08 L, women 6.60 H - 5.79 L, standard deviation 0.7 and 0.6 L;
 * measured upright, so less SUPINE_FULL_UPRIGHT_GAIN; and 0.86 L of tissue (Denison 1986, Thorax
 * 41:620, n 12: 431 mL in each lung). The paper of the ECSC was not at hand: an implementation of
 * its table in R (getQuanjerPred, getQuanjerLLN; lower limits 1.15 and 0.99 L below the prediction,
 * 1.645 standard deviations) confirms the coefficients. At 40 years they agree within 5 %, for men
 * of 1.60 to 1.95 m and women of 1.50 to 1.80 m, with the medians of Hall et al. (Eur Respir J 57:
 * 2000289, 2021), their splines left out. */
#ifndef SUPINE_CAPACITY_H
#define SUPINE_CAPACITY_H

#include "precompute/physics/reference.h"

typedef enum supine_sex { SUPINE_SEX_UNKNOWN = 0, SUPINE_SEX_FEMALE, SUPINE_SEX_MALE } supine_sex;

/** Height and sex of a person, where they are known. */
typedef struct supine_person {
  double height; /**< cm; 0: not given */
  supine_sex sex;
} supine_person;

/** Find the volume of both lungs at full inflation, supine, gas and tissue, mL: the least and the
 * largest of usual adults if height or sex is unknown, else the same value twice. */
void supine_reference_capacity(const supine_person *person, double range[2]);

/** Append the full volume, mL, expected of the reference's lungs to text [size]: "expected 6500",
 * or "an adult's 4566 to 8525" if height or sex is unknown. */
void supine_reference_compare(const supine_reference *reference, const supine_person *person,
                              char *text, size_t size);

/** Warn if the full volume is implausible for the person, or if a scan at rest contradicts a given
 * volume at rest.
 * @param given  volumes at rest before supine_reference_resting_settle
 * @param text   [size] the warning; empty if there is none */
void supine_reference_doubt(const supine_reference *reference, const supine_person *person,
                            const supine_resting *given, char *text, size_t size);

#endif
