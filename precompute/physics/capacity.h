/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Volume of a person's lungs at full inflation, and warnings where a scan's stated state is
 * implausible. Total lung capacity of adults by height H in m (ECSC: Quanjer et al., Eur Respir J 6
 * Suppl 16, 1993): men 7.99 H - 7.08 L, women 6.60 H - 5.79 L, standard deviation 0.7 and 0.6 L;
 * measured upright, so less SUPINE_FULL_UPRIGHT_GAIN; and 0.86 L of tissue (Denison 1986, Thorax
 * 41:620, n 12: 431 mL in each lung). The paper of the ECSC was not at hand: an implementation of
 * its table in R (getQuanjerPred, getQuanjerLLN; limits 1.15 and 0.99 L, 1.645 standard deviations)
 * confirms the coefficients. At 40 years they agree within 5 %, for men of 1.60 to 1.95 m and women
 * of 1.50 to 1.80 m, with the medians of Hall et al. (Eur Respir J 57: 2000289, 2021), splines left
 * out. */
#ifndef SUPINE_CAPACITY_H
#define SUPINE_CAPACITY_H

#include "precompute/physics/reference.h"

typedef enum supine_sex { SUPINE_SEX_UNKNOWN = 0, SUPINE_SEX_FEMALE, SUPINE_SEX_MALE } supine_sex;

/** What is known of a person. */
typedef struct supine_person {
  double height; /**< cm; 0: not given */
  supine_sex sex;
} supine_person;

/** Find the volume of both lungs at full inflation, supine, gas and tissue, mL: the range of
 * usual adults if the person is unknown, else twice the same value. */
void supine_reference_capacity(const supine_person *person, double range[2]);

/** Append the expected full volume in words: "expected 6500", "an adult's 4573 to
 * 8525". */
void supine_reference_compare(const supine_reference *reference, const supine_person *person,
                              char *text, size_t size);

/** Compare the reference with the person, and the scan with the given volume at rest.
 * @param text  the warning; empty if there is none */
void supine_reference_doubt(const supine_reference *reference, const supine_person *person,
                            const supine_resting *told, char *text, size_t size);

#endif
