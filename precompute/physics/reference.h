/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Move a scan to full inflation, the reference surface of every posture.
 *
 * A lung at full inflation has nearly the same shape in every posture; at smaller volumes the
 * lowest regions are the emptiest (Milic-Emili 1966; Glazier 1967 found alveoli of one size at 30
 * cmH2O). Displacements are therefore measured from full inflation:
 *
 *     x_ij(g) = p_ij + A_j F_i(g) d_ij
 *
 *     x_ij  coordinate j of vertex i, with gravity along g
 *     p     surface at full inflation
 *     A_j   gain of the lung along axis j: a factor that follows from the volume of the lung
 *     F_i   force that vertex i retains after exchange with its neighbours (equilibrium.h)
 *     d_i   displacement of vertex i at a force of 1, mm (force.h)
 *
 * A scan shows the lungs at such positions x. As F and d depend on p, p is the fixed point of
 *
 *     p_ij = scan_ij - A_j F_i(g_scan; p) d_ij(p)
 *
 * For one person, p is nearly the same whatever state was scanned. */
#ifndef SUPINE_REFERENCE_H
#define SUPINE_REFERENCE_H

#include <supine/state.h>

#include <supine/findings.h>

#include "precompute/physics/model.h"
#include "precompute/physics/resting.h"

typedef struct supine_scan {
  bool known;         /**< whether the state is known; if not, the scan is the reference surface */
  supine_state state; /**< posture, and rest or full inflation plus or minus a volume in mL */
  double full;        /**< known volume at full inflation of the scanned lungs, mL; 0 if unknown */
} supine_scan;

/** Parse a scan's state: "full", "supine:rest", "left:rest+300", "full-2000", or "none". The
 * default posture is supine. */
supine_status supine_physics_reference_scan_parse(const char *text, supine_scan *scan,
                                                  supine_error *error);

/** Axes and unit of the input files; both are zero if the files have different axes. */
typedef struct supine_scan_frame {
  supine_axes axes;
  double millimetres_per_unit;
} supine_scan_frame;

/** State of a scan, and volumes (gas and tissue) that the lungs have if none is collapsed. */
typedef struct supine_reference {
  bool known; /**< whether the state of the scan and the volumes are known */
  supine_scan scan;
  supine_resting resting; /**< volumes at rest as shares of full_volume */
  size_t lung_count;
  int side[2];           /**< [lung] +1 left, -1 right */
  double full_volume[2]; /**< [lung] volume of the reference surface (full inflation), mL */
  double scan_volume[2]; /**< [lung] volume in the scan minus full_volume, mL */
  double scan_rest[2];   /**< [lung] volume at rest in the scan's posture, mL; 0 if unused */
  /** [lung, axis] factors by which displacements from full inflation are scaled in the scan */
  double scan_gains[2][3];
  size_t solves; /**< number of iterations to find the surface at full inflation */
} supine_reference;

/** Find the volumes of scanned lungs at full inflation, and move the lungs to full inflation.
 * @param lungs  the vertices and the bounding box are changed, the midline is not */
supine_status supine_physics_reference_find(supine_lungs *lungs, const supine_model *model,
                                            const supine_scan *scan, const supine_resting *resting,
                                            supine_reference *reference, supine_error *error);

/** Compute the volume of each lung at rest, with gravity along g, into ml. Return their sum. */
double supine_physics_reference_rest(const supine_reference *reference, const double g[3],
                                     double *ml);

/** Compute the volume of each lung at full inflation into ml [lung_count]. Return their sum. */
double supine_physics_reference_full(const supine_reference *reference, const double g[3],
                                     double *ml);

/** Divide the volume `total`, mL, between the lungs so that both are filled to the same degree
 * between rest and full inflation. Write their volumes to ml [lung_count]. */
void supine_physics_reference_share_out(const supine_reference *reference, const double g[3],
                                        double total, double *ml);

/** Move the vertices of scanned lungs to full inflation, in place, where each lung has the volume
 * reference->full_volume. Write the vertices of the scan to lungs->scanned, and set
 * reference->scan_gains and reference->solves. Statuses as supine_physics_reference_find. */
supine_status supine_physics_reference_inflate(supine_lungs *lungs, const supine_model *model,
                                               supine_reference *reference, supine_error *error);

/** Find the gains A of each lung in the scan, reference->scan_gains: factors of its displacement
 * from full inflation along x, y and z. At rest, the gains on all axes are equal, s. Displacing the
 * scan with gains -A gives the volume at full inflation, and with gains s - A the volume at rest.
 * @param scan        closed lungs with the scan's vertices
 * @param bend        [3] curvature of a vertex's path to rest (supine_volume_bend); 0: straight
 * @param directions  [vertices, 3] displacement of each vertex at a force of 1, mm
 * @param amounts     [vertices] force that each vertex retains after exchange with its neighbours
 */
supine_status supine_physics_reference_find_gains(const supine_lungs *scan, const double bend[3],
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
void supine_physics_reference_capacity(const supine_person *person, double range[2]);

/** Return whether a height is outside the heights of the adults for whom the equations are stated.
 * @param range  [2] least and greatest height for the person's sex, or for either, cm, written */
bool supine_physics_reference_height_is_told(const supine_person *person, double range[2]);

/** Set resting->ml for supine to the volume at rest that height and sex predict, unless these are
 * unknown, a volume at rest is given or the scan was at rest.
 * @param reference  `scan`, `lung_count` and `side` are used */
void supine_physics_reference_predict_rest(const supine_reference *reference,
                                           const supine_person *person, supine_resting *resting);

/** Append the expected volume at full inflation, mL, to text [size]: "expected 6500", or "an
 * adult's 4566 to 8525" if height or sex is unknown. */
void supine_physics_reference_compare(const supine_reference *reference,
                                      const supine_person *person, char *text, size_t size);

/** Add a warning if the volume at full inflation is implausible for the person, and one if the
 * volume of a scan at rest contradicts the volume that the user gave for rest.
 * @param given  the user's volumes at rest, before supine_physics_resting_settle */
void supine_physics_reference_doubt(const supine_reference *reference, const supine_person *person,
                                    const supine_resting *given, supine_findings *findings);

#endif
