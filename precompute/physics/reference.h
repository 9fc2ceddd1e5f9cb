/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Move a scan to full inflation, the reference surface of every posture.
 *
 * A lung at full inflation has nearly the same shape in every posture; at smaller volumes the
 * lowest regions are the emptiest (Milic-Emili 1966; Glazier 1967 found alveoli of one size at 30
 * cmH2O). So displacements are counted from full inflation, down to rest and beyond:
 *
 *     x_ij(g) = p_ij + A_j F_i(g) d_ij     p: the surface at full inflation; A: gains of each
 *                                          lung, from its volume (supine_volume_form_gains)
 *
 * A scan is one such state with unknown p. As F and d depend on p, p is the fixed point of
 *
 *     p_j = scan_j - A_j F(g_scan; p) d_j(p)       A from the volume between the scan and full
 *                                                  inflation
 *
 * For one person, p is nearly the same whatever state was scanned. */
#ifndef SUPINE_REFERENCE_H
#define SUPINE_REFERENCE_H

#include <supine/state.h>

#include "precompute/physics/model.h"
#include "precompute/physics/resting.h"

/** The state that a scan shows. */
typedef struct supine_scan {
  bool known;         /**< false: the scan itself is the reference surface, and rest is unknown */
  supine_state state; /**< rest or full inflation, and mL beyond it */
} supine_scan;

/** Parse a scan's state: "full", "supine:rest", "left:rest+300", "full-2000", or "none". The
 * default posture is supine.
 * @retval SUPINE_ERROR_ARGUMENT  anything else; `error` lists the valid forms */
supine_status supine_reference_scan_parse(const char *text, supine_scan *scan, supine_error *error);

/** Axes and unit of the input files; both are zero if the files' axes differ. */
typedef struct supine_scan_frame {
  supine_axes axes;
  double millimetres_per_unit;
} supine_scan_frame;

/** Volumes of each lung, as if healthy, and the gains of the scan. Volumes are in mL, gas and
 * tissue. */
typedef struct supine_reference {
  bool known; /**< false: volumes are relative to the scan, and rest is unknown */
  supine_scan scan;
  supine_resting resting; /**< as shares: volumes in mL are converted */
  size_t lung_count;
  int side[2];             /**< +1 left, -1 right */
  double full_volume[2];   /**< F, volume of the reference surface */
  double scan_volume[2];   /**< volume of the scan minus F: negative below full inflation */
  double scan_rest[2];     /**< volume at rest in the scan's posture; 0 if the scan is full */
  double scan_gains[2][3]; /**< A of the scan */
  size_t solves;           /**< number of solves to reach the fixed point */
} supine_reference;

/** Move lungs from the scan to the reference, in place.
 * @param lungs  vertices and box change; the midline stays
 * @retval SUPINE_ERROR_ARGUMENT      a scan below the volume of its tissue, or above full inflation
 * @retval SUPINE_ERROR_NUMERICAL     the surface folds on the way, or no fixed point is found
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_MESH */
supine_status supine_reference_find(supine_lungs *lungs, const supine_model *model,
                                    const supine_scan *scan, const supine_resting *resting,
                                    supine_reference *reference, supine_error *error);

/** Compute the volume of each lung at rest into ml [lung_count], with gravity along the unit vector
 * g. Return their sum. */
double supine_reference_rest(const supine_reference *reference, const double g[3], double *ml);

/** Compute the same at full inflation. */
double supine_reference_full(const supine_reference *reference, const double g[3], double *ml);

/** Divide `total` mL between the lungs into ml [lung_count], with the same t of resting.h. */
void supine_reference_share_out(const supine_reference *reference, const double g[3], double total,
                                double *ml);

/** Move scanned lungs to their reference volumes, in place, by solving for the fixed point above.
 * lungs->scanned takes the vertices of the scan. Statuses as supine_reference_find.
 * @param reference  has the scan and the volumes; scan_gains and solves are written */
supine_status supine_reference_inflate(supine_lungs *lungs, const supine_model *model,
                                       supine_reference *reference, supine_error *error);

/** Find the gains of the scan at which the reference surface's field, applied to the scan, gives
 * the volumes of full inflation and of rest.
 * @param scan        closed lungs with the scan's vertices
 * @param directions  [N, 3] d, mm
 * @param amounts     [N] F along the scan's gravity
 * @param reference   has the volumes; scan_gains are written
 * @retval SUPINE_ERROR_NUMERICAL  no gains give these volumes */
supine_status supine_reference_find_gains(const supine_lungs *scan, const double bend[3],
                                          const double *directions, const double *amounts,
                                          supine_reference *reference, supine_error *error);

typedef enum supine_sex { SUPINE_SEX_UNKNOWN = 0, SUPINE_SEX_FEMALE, SUPINE_SEX_MALE } supine_sex;

/** Height and sex of a person, where they are known. */
typedef struct supine_person {
  double height; /**< cm; 0: not given */
  supine_sex sex;
} supine_person;

/** Estimate the volume of both lungs at full inflation, supine, gas and tissue, in mL: the smallest
 * and the largest of usual adults if height or sex is unknown, else the same value twice. */
void supine_reference_capacity(const supine_person *person, double range[2]);

/** Append the full volume, mL, expected of the reference's lungs to text [size]: "expected 6500",
 * or "an adult's 4566 to 8525" if height or sex is unknown. */
void supine_reference_compare(const supine_reference *reference, const supine_person *person,
                              char *text, size_t size);

/** Write a warning if the full volume is implausible for the person, or if a scan at rest
 * contradicts a given volume at rest.
 * @param given  volumes at rest before supine_reference_resting_settle
 * @param text   [size] the warning; empty if there is none */
void supine_reference_doubt(const supine_reference *reference, const supine_person *person,
                            const supine_resting *given, char *text, size_t size);

#endif
