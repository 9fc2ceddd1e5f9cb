/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Move a scan to full inflation, the reference surface of every posture.
 *
 * A lung at full inflation has nearly the same shape in every posture; at smaller volumes the
 * lowest regions are the emptiest (Milic-Emili 1966; Glazier 1967 found alveoli of one size at 30
 * cmH2O). Displacements are therefore measured from full inflation. With gravity along g,
 * coordinate j of vertex i is
 *
 *     x_ij(g) = p_ij + A_j F_i(g) d_ij
 *
 * where p is the surface at full inflation, F the catch (equilibrium.h), d the direction (force.h)
 * and A the gains of the lung, which follow from its volume (supine_volume_form_gains). A scan
 * shows the lungs at such positions x. As F and d depend on p, the unknown p is the fixed point of
 *
 *     p_j = scan_j - A_j F(g_scan; p) d_j(p)
 *
 * where A follows from the difference in volume between the scan and full inflation. For one
 * person, p is nearly the same whatever state was scanned. */
#ifndef SUPINE_REFERENCE_H
#define SUPINE_REFERENCE_H

#include <supine/state.h>

#include "precompute/physics/model.h"
#include "precompute/physics/resting.h"

typedef struct supine_scan {
  bool known;         /**< whether the state is known; if not, the scan is the reference surface */
  supine_state state; /**< rest or full inflation, plus or minus a volume in mL */
} supine_scan;

/** Parse a scan's state: "full", "supine:rest", "left:rest+300", "full-2000", or "none". The
 * default posture is supine.
 * @retval SUPINE_ERROR_ARGUMENT  anything else; `error` lists the valid forms */
supine_status supine_reference_scan_parse(const char *text, supine_scan *scan, supine_error *error);

/** Axes and unit of the input files; both are zero if the files have different axes. */
typedef struct supine_scan_frame {
  supine_axes axes;
  double millimetres_per_unit;
} supine_scan_frame;

/** State of the scan, and volumes of healthy lungs: gas and tissue, mL. */
typedef struct supine_reference {
  bool known; /**< whether the volume at rest is known; if not, volumes refer to the scan */
  supine_scan scan;
  supine_resting resting; /**< volumes at rest as shares of full_volume */
  size_t lung_count;
  int side[2];           /**< +1 left, -1 right */
  double full_volume[2]; /**< volume F of the reference surface */
  double scan_volume[2]; /**< volume of the scan minus full_volume; negative below full inflation */
  double scan_rest[2];   /**< volume at rest in the posture of the scan; 0 for a full scan */
  double scan_gains[2][3]; /**< gains x, y, z that take each lung from full inflation to the scan */
  size_t solves; /**< number of solves of the full physics to find the surface at full inflation */
} supine_reference;

/** Find the reference volumes of scanned lungs, and move the lungs to full inflation, in place.
 * @param lungs  vertices and box change; the midline stays
 * @retval SUPINE_ERROR_ARGUMENT      a scan below the volume of its tissue, or above full inflation
 * @retval SUPINE_ERROR_NUMERICAL     the surface folds on the way, or no fixed point is found
 * @retval SUPINE_ERROR_MEMORY, SUPINE_ERROR_MESH */
supine_status supine_reference_find(supine_lungs *lungs, const supine_model *model,
                                    const supine_scan *scan, const supine_resting *resting,
                                    supine_reference *reference, supine_error *error);

/** Compute the volume of each lung at rest into ml [lung_count]. g is the direction of gravity.
 * Return the sum. */
double supine_reference_rest(const supine_reference *reference, const double g[3], double *ml);

/** Compute the volume of each lung at full inflation into ml [lung_count]. Return their sum. */
double supine_reference_full(const supine_reference *reference, const double g[3], double *ml);

/** Divide the volume `total`, mL, between the lungs so that all have the same degree of filling t
 * (resting.h). Write their volumes to ml [lung_count]. */
void supine_reference_share_out(const supine_reference *reference, const double g[3], double total,
                                double *ml);

/** Move the vertices of scanned lungs to full inflation, in place. Each lung then has the volume
 * reference->full_volume. lungs->scanned receives the vertices of the scan. Statuses as
 * supine_reference_find.
 * @param reference  has the scan and the volumes; scan_gains and solves are written */
supine_status supine_reference_inflate(supine_lungs *lungs, const supine_model *model,
                                       supine_reference *reference, supine_error *error);

/** Find the gains A of each lung in the scan, where gain 0 is full inflation and gain s is rest.
 * Displacing the scan with gains -A must give the volume at full inflation. Displacing it with
 * gains s - A must give the volume at rest.
 * @param scan        closed lungs with the scan's vertices
 * @param directions  [N, 3] directions d of displacement, mm
 * @param amounts     [N] catch F (force that each vertex keeps), with gravity as in the scan
 * @param reference   has the volumes; scan_gains are written
 * @retval SUPINE_ERROR_NUMERICAL  no gains give these volumes */
supine_status supine_reference_find_gains(const supine_lungs *scan, const double bend[3],
                                          const double *directions, const double *amounts,
                                          supine_reference *reference, supine_error *error);

typedef enum supine_sex { SUPINE_SEX_UNKNOWN = 0, SUPINE_SEX_FEMALE, SUPINE_SEX_MALE } supine_sex;

typedef struct supine_person {
  double height; /**< cm, or 0 if unknown */
  supine_sex sex;
} supine_person;

/** Estimate the volume of both lungs at full inflation, supine, as a range in mL of gas and tissue.
 * If the height or the sex is unknown, the range covers the usual heights of adults or both sexes.
 * If both are known, the two values are equal. */
void supine_reference_capacity(const supine_person *person, double range[2]);

/** Append the expected volume at full inflation, mL, to text [size]: "expected 6500", or "an
 * adult's 4566 to 8525" if height or sex is unknown. */
void supine_reference_compare(const supine_reference *reference, const supine_person *person,
                              char *text, size_t size);

/** Write a warning if the volume at full inflation is implausible for the person, or if the volume
 * of a scan at rest contradicts the volume that the user gave for rest.
 * @param given  the user's volumes at rest, before supine_reference_resting_settle
 * @param text   [size] the warning; empty if there is none */
void supine_reference_doubt(const supine_reference *reference, const supine_person *person,
                            const supine_resting *given, char *text, size_t size);

#endif
