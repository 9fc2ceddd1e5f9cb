/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Write and read patient.json, which holds a patient's displacement law, the two scanned
 * states and the errors of the fit. Make a physical model from such a law. */
#ifndef SUPINE_PATIENT_FILE_H
#define SUPINE_PATIENT_FILE_H

#include "precompute/patient/krige.h"
#include "precompute/physics/reference.h"

enum { SUPINE_PATIENT_TEXT = 48, SUPINE_PATIENT_OTHERS_MAX = 8, SUPINE_PATIENT_STATE_TEXT = 160 };

/** The fit to a further state of the same lungs. */
typedef struct supine_patient_further {
  supine_state state;
  bool fits_gain; /**< whether the gain is fitted: only if the posture is not the fitted one */
  /** Factors of the left and the right lung on the displacement from full inflation to rest. */
  double scale[2];
  double residual;              /**< RMS residual, mm; along the normals for a surface */
  double residual_without_gain; /**< RMS residual of a fit with a gain of 0, mm */
  double gain, gain_error;      /**< gain and its standard error */
} supine_patient_further;

/** A region of a lung. The expandability a = 1/E at a point p ([Santhanam2008] VI) is a weighted
 * mean of the expandabilities a_k of all regions k in the same lung:
 *
 *     a(p) = sum over k of w(|p - centre_k| / radius_k) a_k
 *            / sum over k of w(|p - centre_k| / radius_k)
 *     w(t) = 1 for t <= 1/2, 0 for t >= 1, 3 q^2 - 2 q^3 between, q = 2 (1 - t) */
typedef struct supine_patient_region {
  double side;      /**< +1 left lung, -1 right lung */
  double value;     /**< expandability, > 0 */
  double centre[3]; /**< centre in the reference surface, mm */
  double radius;    /**< mm, > 0 */
  double seen;      /**< share of `value` that the surfaces, not the prior, determine, 0 to 1 */
} supine_patient_region;

/** The regions of the left lung, then those of the right lung; if count is 0, uniform tissue. */
typedef struct supine_patient_stiffness {
  size_t count;
  supine_patient_region region[SUPINE_PATIENT_REGIONS_MAX];
} supine_patient_stiffness;

#define SUPINE_PATIENT_SEEN 0.5 /**< smallest `seen` of a region that counts as determined */

/** Errors with uniform tissue [0] and with the fitted regions of expandability [1]. */
typedef struct supine_patient_expand_report {
  bool tried, kept;
  double fitted[2];   /**< RMS distance between the surfaces along normals, mm */
  double held_out[2]; /**< RMS distance at held-out points, mm */
  double unseen;      /**< number of regions with `seen` below SUPINE_PATIENT_SEEN */
} supine_patient_expand_report;

/** The applied force f that a measured displacement implies ([Santhanam2008] IV-B.3), without an
 * assumption about its form. At vertex i, u_i is the displacement to the other surface, d_i the
 * fitted direction (15)-(17), and F_i the spread force:
 *
 *     F_i = u_i . d_i / |d_i|^2
 *     f = A F                    A inverts the spreading of the force (equilibrium.h)
 *
 * A amplifies roughness of u, so f is averaged over blocks of 40 mm of surface. */
typedef struct supine_patient_applied {
  double blocks;      /**< number of blocks, or 0 if the force was not computed */
  double correlation; /**< correlation of force and height along gravity */
  double slopes[3];   /**< slopes c7 to c9 of the force along X, Y and Z */
  double residual;    /**< RMS residual of the fitted slopes / force at the box's centre */
  double spread;      /**< standard deviation of the blocks' forces / force at the box's centre */
} supine_patient_applied;

typedef struct supine_patient_surface_report {
  double vertices;      /**< number of matched vertices, or 0 without surfaces */
  double matched;       /**< share of vertices whose nearest point faces the same way */
  double before, after; /**< RMS distance of the surfaces before and after the fit, mm */
} supine_patient_surface_report;

typedef struct supine_patient_record {
  char name[SUPINE_PATIENT_TEXT];
  supine_patient patient;
  supine_force_law force; /**< force of the displacement law in any posture */
  supine_state state[2];  /**< the two scanned states: the fuller, then the emptier */
  double volume[2];       /**< volumes of the two states, mL, or 0 if unknown */
  double emptier[2][3];   /**< minimum and maximum of the emptier state's box, mm */
  bool from_surface;      /**< whether the boxes are those of surfaces, not of landmarks */
  supine_patient_fit_report report;
  supine_patient_stiffness stiffness;
  supine_patient_surface_report surface;
  supine_patient_expand_report expand;
  supine_patient_applied applied;
  double gain_error;    /**< standard error of the gain, or 0 if it was not fitted */
  size_t further_count; /**< number of further states; 0 after supine_patient_read */
  supine_patient_further further[SUPINE_PATIENT_OTHERS_MAX];
  bool gain_undetermined; /**< whether the fitted gain is outside 0.01 to 2 and therefore ignored */
} supine_patient_record;

/** Write the record to a file. A failure leaves no incomplete file.
 * @param made_by  command line, or NULL
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_MEMORY */
supine_status supine_patient_write(const char *path, const supine_patient_record *record,
                                   const char *made_by, supine_error *error);

/** Return a record as JSON, which the caller releases, or NULL if out of memory. */
struct json_t *supine_patient_encode(const supine_patient_record *record, const char *made_by);

/** Return a record as JSON text, which the caller frees, or NULL if out of memory. */
char *supine_patient_text(const supine_patient_record *record, const char *made_by);

/** Read a record from a file.
 * @retval SUPINE_ERROR_READ    the file cannot be opened
 * @retval SUPINE_ERROR_FORMAT  a key is missing or invalid */
supine_status supine_patient_read(const char *path, supine_patient_record *record,
                                  supine_error *error);

/** Set force, directions and stiffness of a model to those of a patient. The direction of a vertex
 * is d = -u / (f s). u is the displacement from the fuller to the emptier scanned state, scaled to
 * lead from full inflation to rest. In the fitted posture, f is the force before and f s the force
 * after spreading over the surface. If f or s is below 0.2, it is replaced by 0.2.
 *
 * @param resting  volumes at rest
 * @param lungs    the scan of one of the two states
 * @param state    0 if the scan shows the fuller state, 1 if the emptier one
 * @param arrays   [4 N], written: the directions [N, 3], mm, then the relative stiffness E [N];
 *   must outlive the model
 * @retval SUPINE_ERROR_MEMORY, those of supine_physics_solve */
supine_status supine_patient_model(const supine_patient_record *record,
                                   const supine_resting *resting, const supine_lungs *lungs,
                                   size_t state, double *arrays, supine_model *model,
                                   supine_error *error);

/** Find which of the two scanned states a surface shows, by comparing the bounding boxes.
 * @param state  written: 0 for the fuller state, 1 for the emptier one
 * @retval SUPINE_ERROR_MESH  the surface lies elsewhere, or is the other lung */
supine_status supine_patient_check_place(const supine_patient_record *record,
                                         const supine_lungs *lungs, size_t *state,
                                         supine_error *error);

/** Compute the gains of the two scanned states along x, y and z on the path of the default law
 * (deep) from full inflation to rest (supine_volume_bend). A state that is neither full inflation
 * nor rest is placed on the path by the cube root of its volume. If this volume is unknown, the
 * fuller state counts as full inflation, and the emptier one as rest. */
void supine_patient_path(const supine_patient_record *record, double gains[2][3]);

/** Scale the volumes at rest to those of the patient. Leave them unchanged unless one scanned
 * state is given relative to rest and the other relative to full inflation. */
void supine_patient_resting(const supine_patient_record *record, supine_resting *resting);

/** Describe a scan that shows one of the patient's two states.
 * @param volume  volume of the scan, mL
 * @return the scan; `known` is false if its volume relative to full inflation is unknown */
supine_scan supine_patient_scan(const supine_patient_record *record, size_t state, double volume,
                                const supine_resting *resting);

/** Fit a displacement law to the surfaces of two states of the same lungs, which may have different
 * triangles. Write patient, reports, stiffness and applied force into the record.
 *
 * Each round displaces vertices of the reference surface by the present law and matches them to the
 * nearest points of the other surface. If both normals of a match agree to within 60 degrees, only
 * the distance along the normal is fitted, so that surfaces may slide. The law is then fitted with
 * robust weights (Tukey's biweight). Rounds end when the vertices move by less than 0.002 mm (RMS).
 *
 * A small distance between the surfaces does not prove the displacement of points, because sliding
 * along the surface is not observed.
 * @param rest           the reference surface, in the fuller state
 * @param state          the same lungs in the emptier state, mm, in the same frame
 * @param landmarks      pairs to fit as well; ignored if `expandability` is true
 * @param expandability  also fit the expandability (supine_patient_expand), with the paper's law
 *   and no correction
 * @retval SUPINE_ERROR_MESH  no overlap (frames, units or sides differ), equal surfaces, or too few
 *   matches
 * @retval those of supine_patient_fit */
supine_status supine_patient_fit_surface(const supine_lungs *rest, const supine_mesh *state,
                                         const supine_patient_pairs *landmarks,
                                         const supine_patient_fit_options *options,
                                         bool expandability, supine_patient_record *record,
                                         supine_error *error);

/** Fit the gain to a further state j of the same lungs. Point p moves from full inflation by
 *
 *     u_j(p) = s_j (1 + gain_j (h_j(p) - h(p)) / f(p)) u(p) + t_j
 *
 * u is the fitted displacement, scaled to lead from full inflation to rest (supine_patient_path).
 * s_j is a scale for each lung. h_j and h are the heights along gravity in the posture of state j
 * and in the fitted posture; f is the fitted force. On a surface, heights and force are spread
 * (equilibrium.h). Scales, gain and t_j are fitted by least squares. A surface is matched again
 * before each fit.
 * @param rest     the surface of the fuller state; NULL if `surface` is NULL
 * @param pairs    points in the fuller state and in state j; NULL if `surface` is given
 * @param scans_moved  also fit a translation t_j between the scans
 * @param further  in: the state; out: the fit
 * @retval SUPINE_ERROR_MESH    too few matches
 * @retval SUPINE_ERROR_MEMORY, those of supine_physics_equilibrium_solve */
supine_status supine_patient_gain_fit(const supine_patient_record *record, const supine_lungs *rest,
                                      const supine_patient_pairs *pairs, const supine_mesh *surface,
                                      bool scans_moved, supine_patient_further *further,
                                      supine_error *error);

/** Set the gain of record->force to the mean gain of the further states, weighted by inverse
 * variance. If the mean is not between 0.01 and 2, keep the previous gain. */
void supine_patient_gain_set(supine_patient_record *record);

#endif
