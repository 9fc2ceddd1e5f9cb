/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Write and read patient.json. It holds a formula for the displacement of a patient's lungs
 * (displacement law), the two scanned states and the errors of the fit. Make a physical model. */
#ifndef SUPINE_PATIENT_FILE_H
#define SUPINE_PATIENT_FILE_H

#include "precompute/patient/krige.h"
#include "precompute/physics/reference.h"

enum {
  SUPINE_PATIENT_REGIONS_MAX = 256,
  SUPINE_PATIENT_TEXT = 48,
  SUPINE_PATIENT_OTHERS_MAX = 8,
  SUPINE_PATIENT_STATE_TEXT = 160
};

/** Result of a fit to a third scan, besides the two to which the displacement law was fitted. The
 * gain is the increase of the force from the uppermost to the lowest point of the lungs. */
typedef struct supine_patient_further {
  supine_state state;
  bool fits_gain; /**< whether the gain is fitted; false in the posture of the two scans */
  /** [left, right lung] displacement from full inflation to the third scan / that to rest */
  double scale[2];
  double residual;              /**< RMS residual, mm; of a surface, along its normals */
  double residual_without_gain; /**< RMS residual with a gain of 0, mm */
  double gain, gain_error; /**< increase of the dimensionless force from the uppermost to the lowest
                              vertex, and its standard error */
} supine_patient_further;

/** A region of a lung. The expandability a = 1 / stiffness at a point p ([Santhanam2008] VI) is a
 * weighted mean of the expandabilities a_k of all regions k in the same lung:
 *
 *     a(p) = sum over k of w(t_k) a_k / sum over k of w(t_k),  t_k = |p - centre_k| / radius_k
 *     w(t) = 1 for t <= 1/2, 0 for t >= 1, 3 q^2 - 2 q^3 between, q = 2 (1 - t) */
typedef struct supine_patient_region {
  int side;             /**< +1 left lung, -1 right lung */
  double expandability; /**< 1 / relative stiffness, > 0 */
  double centre[3];     /**< centre in the reference surface, mm */
  double radius; /**< distance from the centre at which the weight of the region becomes 0, mm */
  double determined; /**< how far the surfaces determine the stiffness: 0 not at all, 1 fully */
} supine_patient_region;

/** Stiffness of regions of the left lung, then of the right. Without regions, it is uniform. */
typedef struct supine_patient_stiffness {
  size_t count;
  supine_patient_region region[SUPINE_PATIENT_REGIONS_MAX];
} supine_patient_stiffness;

/** Regions with a smaller supine_patient_region.determined count as undetermined. */
#define SUPINE_PATIENT_DETERMINED 0.5

/** Errors of two fits: [0] with uniform stiffness, [1] with a fitted stiffness of each region. */
typedef struct supine_patient_expand_report {
  bool tried, kept;
  double fitted[2];    /**< [uniform, regional] RMS distance from fitted to scanned surface, mm */
  double held_out[2];  /**< [uniform, regional] the same at held-out vertices, mm */
  size_t undetermined; /**< number of regions whose stiffness the surfaces hardly determine */
} supine_patient_expand_report;

/** The force on the lungs, computed from the displacement of each vertex ([Santhanam2008] IV-B.3)
 * without a formula for the force. At vertex i,
 *
 *     F_i = u_i . d_i / |d_i|^2,    f = A F
 *
 * - u_i is the displacement from the fuller to the emptier surface.
 * - d_i is the displacement that a force of 1 causes, [Santhanam2008] (15)-(17).
 * - F_i is the applied force after smoothing over the surface (smoothing.h).
 * - f is the applied force before smoothing; the matrix A inverts the smoothing.
 * A amplifies roughness of u, so f is averaged over the vertices in each cube of 40 mm. Surfaces of
 * real people do not show f: their motion along the surface is unknown. Where landmarks are given,
 * f = F is computed from their u instead. */
typedef struct supine_patient_applied {
  bool from_landmarks; /**< computed from landmarks; from surfaces, it is unreliable */
  size_t blocks;       /**< number of cubes of 40 mm that contain vertices; 0: not computed */
  double correlation;  /**< correlation of the force with the depth along gravity */
  double slopes[3];    /**< gradient of the force along X, Y and Z (0 to 1 in the bounding box),
                          divided by the force at the lungs' centre */
  double residual; /**< RMS residual of the linear fit, divided by the force at the lungs' centre */
  double spread;   /**< standard deviation of the cubes' forces / force at the lungs' centre */
} supine_patient_applied;

typedef struct supine_patient_surface_report {
  size_t vertices;      /**< number of matched vertices, or 0 without surfaces */
  double matched;       /**< share of vertices whose nearest point has a similar normal */
  double before, after; /**< RMS distance between the surfaces before and after the fit, mm */
} supine_patient_surface_report;

typedef struct supine_patient_record {
  char name[SUPINE_PATIENT_TEXT];
  supine_patient patient;
  supine_force_law force; /**< applied force as a function of posture */
  supine_state state[2];  /**< the two scanned states: the fuller, then the emptier */
  double volume[2];       /**< lung volumes in the fuller and the emptier state, mL; 0 if unknown */
  /** [state][left, right lung] volume of each lung in the scans, mL; 0 if only the sum is known */
  double measured_lung[2][2];
  double emptier[2][3]; /**< minimum and maximum of the emptier state's bounding box, mm */
  bool from_surface;    /**< whether the bounding boxes are those of surfaces, not of landmarks */
  supine_patient_fit_report report;
  supine_patient_stiffness stiffness;
  supine_patient_surface_report surface;
  supine_patient_expand_report expand;
  supine_patient_applied applied;
  bool gain_fitted;     /**< whether a gain was fitted; it is that of `force` if determined */
  double gain_error;    /**< standard error of the fitted gain */
  size_t further_count; /**< number of elements of `further`; 0 after supine_patient_read */
  supine_patient_further further[SUPINE_PATIENT_OTHERS_MAX];
  bool gain_undetermined; /**< whether the fitted gain is outside 0.01 to 2 and ignored */
  bool in_basis; /**< whether supine_patient_model has set `shown` and `path_span`, for a basis */
  size_t shown;  /**< the state that the scan of the basis shows: 0 fuller, 1 emptier */
  /** Displacement between the two states as a share of that from full inflation to rest, along x, y
   * and z. */
  double path_span[3];
  /** [state][left, right lung] volumes of that scan and of its surface, displaced by the law to the
   * other state, mL; 0 if unknown */
  double lung_volume[2][2];
  /** Whether the displaced surface has been moved by `offset` to hold the volume measured there
   * (supine_patient_hold_volume). */
  bool holds_measured;
  double offset[2]; /**< [left, right lung] distance along the outward normals, mm */
} supine_patient_record;

/** Write the record to a JSON file. A failure leaves no incomplete file.
 * @param made_by  command line, or NULL */
supine_status supine_patient_write(const char *path, const supine_patient_record *record,
                                   const char *made_by, supine_error *error);

/** Return the record as a JSON object that the caller releases, or NULL if out of memory. */
struct json_t *supine_patient_encode(const supine_patient_record *record, const char *made_by);

/** Return the record as JSON text that the caller frees, or NULL if out of memory. */
char *supine_patient_text(const supine_patient_record *record, const char *made_by);

/** Compute the displacement of a point by a patient's law, for a basis that was made with this law.
 * A supine_inside_field; its context is a supine_patient_record. */
void supine_patient_field(const void *record, const double point[3], double side, double u[3]);

/** Read the record of a patient's displacement law from JSON text, of a file named `name`. Other
 * statuses: as supine_patient_read. */
supine_status supine_patient_decode(const char *name, const char *text,
                                    supine_patient_record *record, supine_error *error);

/** Read the record of a patient's displacement law from a JSON file. */
supine_status supine_patient_read(const char *path, supine_patient_record *record,
                                  supine_error *error);

/** Set the force, the directions of displacement and the stiffness of a model to those of a
 * patient. Set the volumes at rest and the state of the scan, so that the fitted displacement
 * between the two states is neither enlarged nor reduced: if one of them is full inflation, the
 * other state has the volume of the scan's surface after this displacement, record->lung_volume,
 * which is the measured one (supine_patient_hold_volume). The direction of a vertex is d = -u / F:
 * - u is the patient's displacement of the vertex between the two scanned states, with the
 *   correction for the volume, extrapolated to the displacement from full inflation to rest.
 * - F is the patient's force on the vertex, smoothed over the surface (smoothing.h). The
 *   unsmoothed force, and the ratio of F to it, are at least 0.2.
 * @param record   `in_basis`, `shown`, `path_span`, `volume` and `lung_volume` are written
 * @param lungs    scan of one of the two states
 * @param resting  default volumes at rest; on return those of the patient
 * @param scan     written: the state of the scan; `known` is false if its volume relative to full
 *   inflation is unknown
 * @param arrays   [4 N], written: the directions [N, 3], mm, then the relative stiffness [N]; must
 *   outlive the model */
supine_status supine_patient_model(supine_patient_record *record, const supine_lungs *lungs,
                                   supine_resting *resting, supine_scan *scan, double *arrays,
                                   supine_model *model, supine_error *error);

/** Return the volume at full inflation, supine, mL, of lungs that hold `held` mL in a state named
 * from rest or full inflation; 0 if either is unknown. */
double supine_patient_full_volume(const supine_state *shown, double held,
                                  const supine_resting *resting);

/** Correct a patient's displacement so that the surface of the scan, displaced to the other state,
 * encloses the volume that was measured there: add h n to the displaced positions. n are the
 * normals of the displaced surface, smoothed ten times; h is one distance for each lung, or the
 * same for both if only the sum of their volumes was measured. Do nothing if the volume of these
 * lungs was not measured.
 * @param record        `shown` is read; `holds_measured` and `offset` are written
 * @param fuller        lungs in the fuller state; moved if the scan shows the emptier one
 * @param displacement  [N, 3] displacement from the fuller to the emptier state, mm, changed */
supine_status supine_patient_hold_volume(supine_patient_record *record, supine_lungs *fuller,
                                         double *displacement, supine_error *error);

/** Describe the volume that the lungs hold in the state that the scan does not show, and how the
 * surface was moved to hold it.
 * @param text  [size] output
 * @return whether the surface was moved by more than 3 mm, so that the volume is doubtful */
bool supine_patient_describe_volume(const supine_patient_record *record, char *text, size_t size);

/** Return the constant c of the expected error (supine/locate.h), mm, for a basis of the scan that
 * supine_patient_model has found: smaller for the fuller scan, as it predicts the emptier state. */
double supine_patient_expected(const supine_patient_record *record);

/** Compute gains [state][axis]: the displacement from full inflation to the fuller [0] and to the
 * emptier [1] scanned state, divided by the displacement to rest. The default displacement law
 * gives the path of the vertices to rest; the cube root of a state's volume gives the position on
 * the path. If the volume is unknown, the states count as full inflation and rest. */
void supine_patient_path(const supine_patient_record *record, double gains[2][3]);

/** Return the patient's volume at rest / at full inflation supine, of both lungs, in the posture of
 * scanned state k. Return 0 unless that state is given relative to rest and the other one relative
 * to full inflation, and both volumes are known.
 * @param resting  default volumes, for the postures */
double supine_patient_rest_share(const supine_patient_record *record, size_t k,
                                 const supine_resting *resting);

/** Scale the volumes at rest to those of the patient (supine_patient_rest_share). They stay
 * unchanged if the share is not known, or is outside 0.15 to 0.95. */
void supine_patient_resting(const supine_patient_record *record, supine_resting *resting);

/** Describe a scan that shows one of the patient's two states.
 * @param state   0 for the fuller state, 1 for the emptier one
 * @param volume  volume of the lungs in the scan, mL
 * @return the scan; `known` is false if its volume relative to full inflation is unknown */
supine_scan supine_patient_scan(const supine_patient_record *record, size_t state, double volume,
                                const supine_resting *resting);

/** Fit a displacement law to the surfaces of the same lungs in two states. The surfaces may have
 * different triangles. Write the law, the reports, the stiffness and the applied force into the
 * record.
 *
 * The fit repeats three steps until the vertices move by less than 0.002 mm (RMS):
 * - Displace vertices of `fuller` by the present law, and find the nearest points of `emptier`.
 * - Keep matches whose normals agree to within 60 degrees. Use only the distance along the normal,
 *   so that surfaces may slide. Weight it by Tukey's biweight.
 * - Fit the law to these distances.
 * A small distance between the surfaces does not prove the displacement of points, because sliding
 * along the surface is not observed.
 * @param fuller         the lungs in the state with more air
 * @param emptier        surface of the same lungs with less air, mm, in the same coordinate frame
 * @param landmarks      pairs to fit as well; ignored if `expandability` is true
 * @param expandability  also fit the stiffness of lung regions (supine_patient_expand), with
 *   SUPINE_PATIENT_PAPER and without a kriging correction */
supine_status supine_patient_fit_surface(const supine_lungs *fuller, const supine_mesh *emptier,
                                         const supine_patient_pairs *landmarks,
                                         const supine_patient_fit_options *options,
                                         bool expandability, supine_patient_record *record,
                                         supine_error *error);

/** Fit the increase of the force from the uppermost to the lowest point of the lungs (gain) to a
 * third scan, besides the two to which the displacement law was fitted. The displacement of a point
 * from full inflation to the third scan is modelled as
 *
 *     s (1 + g (h' - h) / f) u + t
 *
 * - u is the displacement of the point from full inflation to rest by the displacement law.
 * - f is the force on the point by this law.
 * - h and h' are its depths along gravity, 0 to 1, in the posture of the two and the third scan.
 * - g is the gain, s a factor for each lung, and t a translation; all three are fitted.
 * @param pairs    points in the fuller and in the third scan
 * @param scans_moved  whether to fit t; otherwise it is 0
 * @param further  in: the state of the third scan; out: the fit */
supine_status supine_patient_gain_fit_landmarks(const supine_patient_record *record,
                                                const supine_patient_pairs *pairs, bool scans_moved,
                                                supine_patient_further *further,
                                                supine_error *error);

/** Fit the gain as supine_patient_gain_fit_landmarks, to the surface of a third scan. f, h and h'
 * are smoothed (smoothing.h), and every fit starts from new matches.
 * @param fuller   surface in the fuller of the two scans
 * @param surface  surface in the third scan */
supine_status supine_patient_gain_fit_surface(const supine_patient_record *record,
                                              const supine_lungs *fuller,
                                              const supine_mesh *surface, bool scans_moved,
                                              supine_patient_further *further, supine_error *error);

/** Set record->force.gain to the mean of the gains in record->further, weighted by 1 /
 * gain_error^2. If the mean is not between 0.01 and 2, keep the previous gain. */
void supine_patient_gain_set(supine_patient_record *record);

#endif
