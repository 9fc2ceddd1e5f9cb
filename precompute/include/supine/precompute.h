/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a basis from the surfaces or the label map of lungs. <supine/runtime.h> opens the basis and
 * deforms the lungs.
 *
 *     static const char *const paths[] = {"left.ply", "right.ply"};
 *     const supine_precompute_options options = {.size = sizeof options,
 *                                                .lungs = {.paths = paths, .path_count = 2},
 *                                                .volumes = {.rest[SUPINE_REST_SUPINE].ml = 2600}};
 *     supine_precompute_result *result = NULL;
 *     supine_status status = supine_precompute_basis(&options, &result, &error);
 *     if (status == SUPINE_OK) {
 *       status = supine_basis_open_memory(result->bytes, result->size, &basis, &error);
 *     }
 *     supine_precompute_result_free(result);
 *
 * Zero-initialise options, and set their size: a member that is zero has its default. A number
 * whose default is not zero is taken as 0 only if the member `has_...` beside it is set. Texts and
 * arrays must live until the call returns. Angles are unit vectors, lengths mm, volumes mL of gas
 * and tissue.
 *
 * Stability: growing. A minor version may change functions and structs without a replacement;
 * CHANGELOG.md says how to move over. */
#ifndef SUPINE_PUBLIC_PRECOMPUTE_H
#define SUPINE_PUBLIC_PRECOMPUTE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/findings.h>
#include <supine/state.h>
#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A closed surface of one lung or of both. */
typedef struct supine_precompute_surface {
  size_t vertex_count;
  const double *vertices; /**< [vertex_count, 3] */
  size_t triangle_count;
  const uint32_t *triangles; /**< [triangle_count, 3] */
} supine_precompute_surface;

/** The lungs: files, or arrays. */
typedef struct supine_precompute_lungs {
  const char *const *paths; /**< [path_count] surfaces; or a label map, or masks */
  size_t path_count;
  const supine_precompute_surface *surfaces; /**< [surface_count], if there are no files */
  size_t surface_count;
  const char *axes; /**< three letters, such as "RAS": where the coordinates grow. Default: those
                       that the file states, or LPS */
  double unit; /**< length of the unit, mm; default 1. If given, lungs of any size are accepted */
  bool has_midline;
  double midline;     /**< x of the sagittal plane between the lungs, mm, LPS; default: found */
  const char *labels; /**< labels of the lungs in a map: the name of a segmenter, "one", or a list
                         such as "left=10+11,right=12+13+14"; default: found */
  double edge;        /**< for label maps: length of the triangles' edges, mm; default 2 */
  double close;       /**< for label maps: close gaps narrower than twice this, mm */
  const char *surfaces_out; /**< for label maps: file to write the surfaces to, or NULL */
} supine_precompute_lungs;

typedef enum supine_precompute_shown {
  SUPINE_SHOWN_DEFAULT = 0, /**< full inflation; of a patient's model, the state that was fitted; of
                               the law PAPER and of fields, as UNKNOWN */
  SUPINE_SHOWN_STATE,       /**< `state` */
  SUPINE_SHOWN_UNKNOWN      /**< the scan is the reference of every posture */
} supine_precompute_shown;

/** The state of the lungs in the scan. */
typedef struct supine_precompute_scan {
  supine_precompute_shown shown;
  supine_state state; /**< a posture, and rest or full inflation plus or minus mL; with fields, the
                         posture alone: gravity does not displace the scan in this posture */
} supine_precompute_scan;

typedef enum supine_precompute_law_kind {
  SUPINE_PRECOMPUTE_LAW_DEFAULT =
      0,                       /**< PAPER if the state of the scan is unknown, otherwise DEEP */
  SUPINE_PRECOMPUTE_LAW_DEEP,  /**< displacement from full inflation, in any state */
  SUPINE_PRECOMPUTE_LAW_PAPER, /**< displacement from the scan, as [Santhanam2008] */
  SUPINE_PRECOMPUTE_LAW_COUNT
} supine_precompute_law_kind;

/** How gravity and volume move the surface: the force on a vertex, and its displacement by a unit
 * force. docs/guide and `supine precompute --help-all` describe the constants. */
typedef struct supine_precompute_law {
  supine_precompute_law_kind kind;
  bool has_base, has_gain, has_box_force, has_constants, has_shear;
  double base;         /**< part of the force that is equal everywhere */
  double gain;         /**< factor of the depth along gravity, 0 to 1 */
  double box_force[3]; /**< parts of the force that are fixed to the body */
  double soften;       /**< how much more lower tissue expands */
  double constants[6]; /**< of the displacement by a unit force */
  double shear;        /**< motion from back to front that grows from apex to base */
  double reach;        /**< distance over which a force spreads along the surface, mm */
} supine_precompute_law;

typedef enum supine_precompute_profile {
  SUPINE_PROFILE_UNIFORM = 0,
  SUPINE_PROFILE_LINEAR,
  SUPINE_PROFILE_EXPONENTIAL
} supine_precompute_profile;

/** A region of changed stiffness. */
typedef struct supine_precompute_lesion {
  double centre[3]; /**< mm, LPS */
  double radius;    /**< mm */
  double factor;    /**< on the stiffness within half of the radius */
} supine_precompute_lesion;

enum { SUPINE_PRECOMPUTE_LESIONS_MAX = 64 };

/** Tissue that differs between regions, and collapsed lungs. */
typedef struct supine_precompute_tissue {
  supine_precompute_profile profile; /**< of the expandability along an axis */
  int axis;        /**< 0: from the midline outwards, 1: from back to front, 2: from apex to base */
  double from, to; /**< relative expandability at both ends of the axis */
  const char *expandability; /**< CSV file of the expandability of each vertex, or NULL */
  size_t lesion_count;
  supine_precompute_lesion lesions[SUPINE_PRECOMPUTE_LESIONS_MAX];
  double
      share[2]; /**< volume of a collapsed left and right lung / its healthy volume; 0: healthy */
} supine_precompute_tissue;

/** Postures with gravity along +x, -x, +y, -y, +z, -z. */
typedef enum supine_precompute_posture {
  SUPINE_REST_LEFT = 0, /**< lying on the left side */
  SUPINE_REST_RIGHT,
  SUPINE_REST_SUPINE,
  SUPINE_REST_PRONE,
  SUPINE_REST_INVERTED,
  SUPINE_REST_UPRIGHT,
  SUPINE_REST_COUNT
} supine_precompute_posture;

/** The patient's volume at rest (FRC) in one posture, in mL or as a share of full inflation. */
typedef struct supine_precompute_rest {
  double ml;       /**< of both lungs */
  double share[2]; /**< of the left and the right lung; if the second is 0, the first is that of
                      both lungs together */
} supine_precompute_rest;

typedef enum supine_precompute_sex {
  SUPINE_PRECOMPUTE_SEX_UNKNOWN = 0,
  SUPINE_PRECOMPUTE_FEMALE,
  SUPINE_PRECOMPUTE_MALE,
  SUPINE_PRECOMPUTE_SEX_COUNT
} supine_precompute_sex;

/** What is known of the patient's volumes. With fields over gravity and volume, rest and full
 * inflation are states that were simulated. */
typedef struct supine_precompute_volumes {
  double full; /**< of a scan at rest, or of fields: volume of all lungs at full inflation, mL */
  supine_precompute_rest rest[SUPINE_REST_COUNT];
  bool copd;     /**< assume the usual share of full inflation at rest in COPD */
  double height; /**< of the patient, cm */
  supine_precompute_sex sex;
} supine_precompute_volumes;

/** How a basis of another simulator's fields stores the displacements of its vertices. */
typedef enum supine_precompute_storage {
  SUPINE_PRECOMPUTE_STORAGE_BEST = 0, /**< clusters if their error is small beside that of modes */
  SUPINE_PRECOMPUTE_STORAGE_MODES,    /**< a vector for each mode: 3 K + 3 products a vertex */
  SUPINE_PRECOMPUTE_STORAGE_CLUSTERS, /**< clusters of vertices that move alike: 15 products */
  SUPINE_PRECOMPUTE_STORAGE_COUNT
} supine_precompute_storage;

/** What the basis is to contain. */
typedef struct supine_precompute_modes {
  bool has_band;
  size_t band;     /**< highest degree of the harmonics, 0 to 64; default 23 or, of fields, the
                      degree with the least error in cross-validation */
  size_t count;    /**< largest number of modes, 1 to 64; default 16 or, of fields, as many as
                      lower the error */
  bool harmonics;  /**< store all (band + 1)^2 harmonics instead of modes */
  size_t held_out; /**< number of directions in which the error is measured; default 100 to 1000 */
  bool without_normals;              /**< leave out the normals: a third of the file */
  supine_precompute_storage storage; /**< of fields */
} supine_precompute_modes;

typedef struct supine_precompute_options {
  size_t size; /**< sizeof(supine_precompute_options) */
  supine_precompute_lungs lungs;
  supine_precompute_scan scan;
  supine_precompute_law law;
  supine_precompute_tissue tissue;
  supine_precompute_volumes volumes;
  supine_precompute_modes modes;
  const char *patient; /**< file of `supine fit`: a patient's model in place of the law; or NULL */
  const char *fields;  /**< file of another simulator's displacements, in place of the law; or NULL:
                          safetensors with points [P,3], gravity [M,3] and displacement [M,P,3] */
  const char *made_by; /**< for the metadata: what makes the basis; or NULL */
  /** Receives the fraction of the work done, 0 to 1, and returns other than 0 to stop; or NULL. */
  int (*progress)(void *context, double fraction);
  void *context;
} supine_precompute_options;

/** Errors over all vertices: RMS, 95th percentile and largest. */
typedef struct supine_precompute_errors {
  double rms, p95, largest;
} supine_precompute_errors;

enum { SUPINE_PRECOMPUTE_BANDS_MAX = 12 };

typedef struct supine_precompute_report {
  size_t lung_count, vertex_count, band, mode_count;
  size_t direction_count; /**< number of held-out directions or, of fields, of all directions */
  /** Errors against exact solutions or, of fields, of each field predicted from the others. */
  supine_precompute_errors relative; /**< as fractions of the RMS displacement */
  supine_precompute_errors mm;
  bool rest_known;  /**< whether the state of the scan and the volumes at rest are known; if so: */
  double rest_part; /**< part of the change from full to rest at which errors in mm were measured */
  double volume;    /**< otherwise: change of volume at which they were measured, mL; 0 of fields */
  double turned_over; /**< share of the triangles that turn over in the worst of six postures, 0 to
                         1 */
  size_t band_count;  /**< of fields: number of bands that the directions determine */
  double
      band_error[SUPINE_PRECOMPUTE_BANDS_MAX]; /**< of fields: error by band in cross-validation */
  /** Of fields: number of volumes for one direction of gravity, 1 if the fields do not depend on
   * volume; and the highest degree of the polynomials of volume. */
  size_t volume_count, order;
  double extrapolated;  /**< of fields over volume: relative RMS error of the smallest and the
                           largest volumes, predicted from the others; 0 if unknown */
  size_t cluster_count; /**< clusters of vertices that move alike; 0 if modes are stored */
  /** Of fields over volume: relative RMS error between the volumes; and what six volumes for each
   * direction would make of it, or 0 if they gain nothing. */
  double volume_error, six_volumes;
  /** Of fields: RMS displacement of all runs, mm; the direction of gravity nearest to that of
   * supine posture, LPS; and the mean displacement along gravity in it, mm. */
  double displacement, nearest_supine[3], along_gravity;
  /** RMS error as a fraction of the RMS of the part of the displacement that depends on gravity; 0
   * if there is none. */
  double turning_rms;
} supine_precompute_report;

typedef struct supine_precompute_result {
  const void *bytes; /**< content of the basis file, or NULL after a failure */
  size_t size;       /**< number of bytes */
  supine_precompute_report report;
  const char *const
      *assumptions; /**< [assumption_count] axes, unit, law, state of the scan, volumes */
  size_t assumption_count;
  const supine_findings *findings; /**< what was found in the input */
} supine_precompute_result;

/** Make a basis. It uses all processors, or as many as the environment variable SUPINE_THREADS
 * says. Thread-safe: several threads may make bases at once. While a call runs, OpenBLAS uses one
 * thread and GSL does not call its error handler, in the whole process; FFTW's planner is locked
 * against other calls of this function only.
 * @param result  written, also on failure, then with the findings alone; NULL if memory is short.
 *   Release it with supine_precompute_result_free
 * @return SUPINE_ERROR_INTERRUPTED if `progress` stopped the work */
SUPINE_API supine_status supine_precompute_basis(const supine_precompute_options *options,
                                                 supine_precompute_result **result,
                                                 supine_error *error);

SUPINE_API void supine_precompute_result_free(supine_precompute_result *result);

/** Return the names of an option's values, ended by NULL: of "law", from SUPINE_PRECOMPUTE_LAW_DEEP
 * on; of "resting", the postures; of "sex"; and of "storage". Return NULL for other texts. */
SUPINE_API const char *const *supine_precompute_names(const char *option);

#ifdef __cplusplus
}
#endif
#endif
