/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Write and read patient.json, a patient's law with its force, states, fit and held-out
 * error, and make the model that the law gives for a surface. */
#ifndef SUPINE_PATIENT_FILE_H
#define SUPINE_PATIENT_FILE_H

#include <supine/state.h>

#include "precompute/patient/krige.h"
#include "precompute/physics/model.h"
#include "precompute/physics/reference.h"

enum { SUPINE_PATIENT_TEXT = 48, SUPINE_PATIENT_OTHERS_MAX = 8, SUPINE_PATIENT_STATE_TEXT = 160 };

/** A further state of the same lungs, as fitted. */
typedef struct supine_patient_further {
  supine_state state;
  bool fits_gain;  /**< the posture differs from the fitted one, so the gain is fitted */
  double scale[2]; /**< factor on the displacement from full inflation to rest, left and right */
  double residual; /**< RMS residual of the fit, mm; of a surface along its normals */
  double residual_without_gain; /**< the same with all of the force fixed to the body */
  double gain, gain_error;      /**< gain and its standard error, by leaving out each eighth of the
                                     lungs (jackknife) */
} supine_patient_further;

/** A region of a patient's expandability a = 1/E ([Santhanam2008] VI), which is a weighted mean
 * over some regions of each lung, independent of the mesh:
 *
 *     a(p) = sum over k of w(|p - centre_k| / radius_k) a_k
 *            / sum over k of w(|p - centre_k| / radius_k)
 *     w(t) = 1 for t <= 1/2, 0 for t >= 1, 3 q^2 - 2 q^3 between, q = 2 (1 - t) */
typedef struct supine_patient_mode {
  double side;      /**< lung: 1 left, -1 right */
  double value;     /**< a_k > 0 */
  double centre[3]; /**< mm, in the reference surface */
  double radius;    /**< mm, > 0 */
  double seen;      /**< contribution of the surfaces, 0 to 1; the remainder comes from
                     * neighbouring regions */
} supine_patient_mode;

/** The regions, of the left lung first; none: uniform tissue. */
typedef struct supine_patient_stiffness {
  size_t count;
  supine_patient_mode mode[SUPINE_PATIENT_REGIONS_MAX];
} supine_patient_stiffness;

/** Least diagonal of the resolution matrix at which a region counts as seen. */
#define SUPINE_PATIENT_SEEN 0.5

/** Fit and held-out error of uniform tissue and of the regions. */
typedef struct supine_patient_expand_report {
  bool tried, kept;
  double fitted[2];   /**< RMS distance between the surfaces along normals, mm, without and with */
  double held_out[2]; /**< the same on held-out blocks */
  double unseen;      /**< number of regions with `seen` below SUPINE_PATIENT_SEEN */
} supine_patient_expand_report;

/** The force that a measured displacement implies ([Santhanam2008] IV-B.3), with no assumption
 * about its form. With u the displacement to the other surface and d the fitted directions
 * (15)-(17),
 *
 *     F_i = u_i . d_i / |d_i|^2
 *     f = A F                    inverts the spreading operator (equilibrium.h)
 *
 * The inversion amplifies the roughness of u by (spreading length / edge length)^2, so f is
 * averaged over blocks of 40 mm of surface: the operator conserves sums. */
typedef struct supine_patient_applied {
  double blocks;      /**< number of blocks; 0: not found */
  double correlation; /**< between force and height along gravity, over the blocks */
  double slopes[3];   /**< c7 to c9 of (18) fitted to the force, 1 at the box's centre */
  double residual;    /**< RMS residual of (18), in units of the force at the box's centre */
  double spread;      /**< RMS of the force about its mean, in the same unit */
} supine_patient_applied;

/** Result of the matching of surfaces. */
typedef struct supine_patient_surface_report {
  double vertices;      /**< number of vertices that took part; 0: no surfaces */
  double matched;       /**< share of them with a compatible point */
  double before, after; /**< RMS distance, point to plane, before and after the fit, mm */
} supine_patient_surface_report;

/** What is known of a person; patient.json holds most of it. */
typedef struct supine_patient_record {
  char name[SUPINE_PATIENT_TEXT]; /**< name of the patient */
  supine_patient patient;
  supine_force_law force; /**< 1 at the box's centre in the emptier state's posture */
  supine_state state[2];  /**< the fuller and the emptier */
  double volume[2];       /**< mL; 0: unknown */
  double emptier[2][3];   /**< box of the emptier state, mm; the fuller one's is the frame */
  bool from_surface;      /**< the boxes are of surfaces, else of landmarks */
  supine_patient_fit_report report;
  supine_patient_stiffness stiffness; /**< no regions: uniform tissue */
  supine_patient_surface_report surface;
  supine_patient_expand_report expand;
  supine_patient_applied applied;
  double gain_error;    /**< standard error of the gain; 0: not fitted */
  size_t further_count; /**< number of further states; supine_patient_read leaves it 0 */
  supine_patient_further further[SUPINE_PATIENT_OTHERS_MAX];
  bool gain_open; /**< the fitted gain is not between 0.01 and 2, so the force keeps its own */
} supine_patient_record;

/** Write the record whole or not at all.
 * @param made_by  command line, or NULL
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_patient_write(const char *path, const supine_patient_record *record,
                                   const char *made_by, supine_error *error);

/** Convert a record to the JSON value of its file, which the caller releases; NULL: no memory. */
struct json_t *supine_patient_encode(const supine_patient_record *record, const char *made_by);

/** Print the text of the file; the caller frees it. NULL: no memory. */
char *supine_patient_text(const supine_patient_record *record, const char *made_by);

/** Read a record.
 * @retval SUPINE_ERROR_READ
 * @retval SUPINE_ERROR_FORMAT  the message names the key that is missing or invalid */
supine_status supine_patient_read(const char *path, supine_patient_record *record,
                                  supine_error *error);

/** Set force, directions and stiffness of a model to a patient's. With u the displacement between
 * the two states, scaled to the whole way from full inflation to rest, and F the spread force in
 * the fitted posture, at least 0.2 of its mean, the directions are
 *
 *     d = -u / F               so that F d is the person's displacement
 *
 * @param resting     volumes at rest
 * @param state       of the surface: 0 the fuller, 1 the emptier
 * @param arrays      [4 N], written: the directions [N, 3], mm, then the relative E [N] by the
 *                    record's regions; must outlive the model
 * @retval SUPINE_ERROR_MEMORY, those of supine_physics_solve */
supine_status supine_patient_model(const supine_patient_record *record,
                                   const supine_resting *resting, const supine_lungs *lungs,
                                   size_t state, double *arrays, supine_model *model,
                                   supine_error *error);

/** Find the state of a surface from its box.
 * @param state  0 the fuller, 1 the emptier
 * @retval SUPINE_ERROR_MESH  the surface lies elsewhere, or is the other lung */
supine_status supine_patient_check_place(const supine_patient_record *record,
                                         const supine_lungs *lungs, size_t *state,
                                         supine_error *error);

/** Compute the gains of the two states along x, y and z: 0 at full inflation, 1 at rest, on the
 * deep law's path between them (supine_volume_bend), by their states or the cube roots of their
 * volumes. Where both are unknown, the fuller state counts as full and the emptier one as rest. */
void supine_patient_path(const supine_patient_record *record, double gains[2][3]);

/** Scale the resting shares to that of the two states, if one of them is at rest and the volume of
 * the other is relative to full inflation. */
void supine_patient_resting(const supine_patient_record *record, supine_resting *resting);

/** Find the state and volume of a scan of one of the two states.
 * @param volume  of the scan, mL
 * @return `known` is false if its distance from full inflation is undetermined */
supine_scan supine_patient_scan(const supine_patient_record *record, size_t state, double volume,
                                const supine_resting *resting);

/* --- from surfaces --------------------------------------------------------------------------- */

/** Fit a law to a surface in another state, of any meshing; write patient, reports, stiffness and
 * applied force into the record.
 *
 * Each round moves every vertex of the reference surface by the present law. The nearest point
 * of the other surface, if its normal is compatible, gives a row along that normal (point to
 * plane, so that surfaces may slide), with a robust weight (Tukey's biweight). The law is then
 * fitted to the rows. Rounds repeat until no vertex moves.
 *
 * A small distance between surfaces does not prove the motion of points: sliding along the
 * surface is not observed.
 * @param rest           surface of the fuller state
 * @param state          the same lungs, mm, same frame
 * @param landmarks      fitted as well, unless empty or with expandability
 * @param expandability  fit it too (supine_patient_expand), with the paper's law, uncorrected
 * @retval SUPINE_ERROR_MESH  no overlap (frames, units or sides differ), equal surfaces, or too
 *   few compatible points
 * @retval those of supine_patient_fit */
supine_status supine_patient_fit_surface(const supine_lungs *rest, const supine_mesh *state,
                                         const supine_patient_pairs *landmarks,
                                         const supine_patient_fit_options *options,
                                         bool expandability, supine_patient_record *record,
                                         supine_error *error);

/* --- from scans in other postures ------------------------------------------------------------ */

/** Fit the gain to a further state, with the fitted field u of the law, scaled to the whole way
 * from full inflation to rest (supine_patient_path):
 *
 *     u_j(p) = s_j (1 + gain_j (h_j(p) - h(p)) / f(p)) u(p) (+ t_j)
 *
 * minus the displacement of the fuller state from full inflation, if known; h are heights along
 * gravity in that posture and the fitted one, f is the fitted force, and of a surface all of them
 * are spread. s_j, s_j gain_j and t_j come from linear least squares; the nearest points of a
 * surface are found again each round.
 * @param rest     the surface of the fuller state; NULL if `surface` is
 * @param pairs    points of the fuller state and of this one; NULL: give `surface`
 * @param moved    also fit a translation between the scans
 * @param further  in: its state; out: the fit
 * @retval SUPINE_ERROR_MESH    too few compatible points
 * @retval SUPINE_ERROR_MEMORY, those of the solve */
supine_status supine_patient_gain_fit(const supine_patient_record *record, const supine_lungs *rest,
                                      const supine_patient_pairs *pairs, const supine_mesh *surface,
                                      bool moved, supine_patient_further *further,
                                      supine_error *error);

/** Set the gain of the record's force to the mean over its further states in other postures,
 * weighted by the inverse variances. */
void supine_patient_gain_take(supine_patient_record *record);

#endif
