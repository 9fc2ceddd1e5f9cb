/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a law to measurements. A landmark gives three rows, a point of a surface one, along the
 * normal of the other surface. A law and the kriging of its residual are fitted together to rows:
 *
 *     value = axis . (u(c) + motion + g) + noise
 *
 * The nine constants c have a normal prior about those of a known law, narrow to keep that law,
 * wide to find a new one. The fit takes the most likely c (generalised least squares,
 * Gauss-Newton with damping); g has the covariance in runtime/kriging.h, or a share of it. */
#ifndef SUPINE_PATIENT_KRIGE_H
#define SUPINE_PATIENT_KRIGE_H

#include <supine/status.h>

#include "precompute/patient/pairs.h"
#include "precompute/patient/patient.h"

/* --- measurements ---------------------------------------------------------------------------- */

typedef struct supine_patient_row {
  supine_patient_place place;
  double axis[3];         /* unit */
  double value;           /* displacement along the axis, mm */
  double weight;          /* weight of the squared residual */
  double noise;           /* standard deviation, mm */
  size_t block;           /* index of the block that it is held out with */
  const double *response; /* [regions] spread force of each region alone; NULL: none is fitted */
} supine_patient_row;

/* Make three rows of each pair into rows [3 count]. */
void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows);

/* Assign each row to a block, a cube of 40 mm of a grid with random origin; return the number of
 * blocks. */
size_t supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                 size_t count, unsigned long seed);

/* Assign each row to a block, and each block at random to a fold. Return the number of blocks; 0:
 * no memory.
 * @param fold  [count] written: the fold of each row */
size_t supine_patient_rows_fold(const supine_patient_frame *frame, supine_patient_row *rows,
                                size_t count, unsigned long seed, size_t *fold);

/* Folds of the held-out blocks, and grids with other origins for which they are repeated. */
enum { SUPINE_PATIENT_FOLDS = 5, SUPINE_PATIENT_SEEDS = 3 };

/* --- the law at a row ------------------------------------------------------------------------ */

/* Unknowns: c1, c3, c5; logarithms of c2, c4, c6; c7 to c9; translation; small rotation;
 * scale of the whole law. The expandability of each region follows, where it is fitted. */
enum { SUPINE_PATIENT_TERMS = 16, SUPINE_PATIENT_REGIONS_MAX = 256 };

/* Compute the derivative of a row by each unknown; return the law's value less the row's, mm. */
double supine_patient_power_design(const supine_patient_power *law, const supine_patient_row *row,
                                   double x[SUPINE_PATIENT_TERMS]);

/* --- maps without a law ---------------------------------------------------------------------- */

enum { SUPINE_PATIENT_AFFINE = 12 };

/* Fit a displacement t or t + M x, x from the box's centre in units of 100 mm; 0 if the fit fails.
 * @param map  t (mm), then M by rows */
void supine_patient_affine_fit(const supine_patient_row *rows, size_t count, bool translation,
                               double map[SUPINE_PATIENT_AFFINE]);

/* Compute the map's value less the row's, mm. */
double supine_patient_affine_residual(const double map[SUPINE_PATIENT_AFFINE],
                                      const supine_patient_row *row);

/* --- the fit --------------------------------------------------------------------------------- */

/* Zero-initialised: the deep law, corrected, no motion between the scans. */
typedef struct supine_patient_fit_options {
  supine_patient_law law;
  supine_patient_moved moved;
  bool uncorrected;  /* leave g out */
  bool size_only;    /* fit only the size of the deep law, and the motion */
  double gravity[3]; /* of the emptier state; all 0: supine */
  double way[3];     /* by axis, as for supine_patient_deep */
  double sill;       /* factor on the covariance of g; 0: the most likely one */
  double noise;      /* factor on the noise of the rows; 0: the most likely one */
  /* Regions whose expandability a_k is fitted, and their prior: the force on a row is the sum over
   * k of a_k response_k, and a - 1 has this precision [regions, regions] and mean 0. */
  size_t region_count;
  const double *precision;
} supine_patient_fit_options;

/* A fit and its working space. */
typedef struct supine_patient_krige {
  const supine_patient_row *rows;
  size_t count;
  supine_patient_fit_options options;
  size_t terms;                              /* unknowns of `design` and `normal` */
  double region[SUPINE_PATIENT_REGIONS_MAX]; /* expandability of each region; 1 of uniform tissue */
  double sill, noise;                        /* factors in use; a sill of 0: no g */
  supine_patient_power mean;                 /* prior mean of the constants */
  supine_patient_power alone;                /* the law fitted without g */
  supine_patient_power law;
  double scaled_sill;            /* factor on the covariance of g, for a law of size 1 */
  supine_patient_centre *centre; /* [count] kernel of each row, without its weight */
  double *factor;                /* [count, count] Cholesky factor of the covariance, if g */
  double *design;                /* [count, terms + 1] whitened derivatives and residual */
  double *weight;                /* [count] weight of each row's kernel */
  double *scratch;               /* [count] */
  double *normal; /* [2, terms, terms] normal matrix, in the end its Cholesky factor; work space */
  double squares; /* squared whitened residual, plus the prior's */
  /* Right-hand side of the normal equations. */
  double right[SUPINE_PATIENT_TERMS + SUPINE_PATIENT_REGIONS_MAX];
} supine_patient_krige;

/* Fit the size of the deep law, which gives the prior's mean, then the law and g. `deep` keeps the
 * shape of that law if the sill is at least 1, that of other patients; otherwise its constants have
 * a prior deviation of 30 %. Those of `paper` have a wide prior. Rows of weight 0 are ignored.
 * @param rows   [count], must outlive the fit
 * @param krige  freed with supine_patient_krige_free, after a failure too
 * @retval SUPINE_ERROR_NUMERICAL  the rows do not determine the law
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_patient_krige_fit(const supine_patient_fit_options *options,
                                       const supine_patient_row *rows, size_t count,
                                       supine_patient_krige *krige, supine_error *error);
void supine_patient_krige_free(supine_patient_krige *krige);

/* Compute the share [regions] of each region's expandability that the rows determine: the diagonal
 * of the resolution matrix. The remainder comes from neighbouring regions. */
void supine_patient_krige_resolution(const supine_patient_krige *krige, double *share);

/* Compute the standard errors of c1 to c9; 0 for a constant that is not fitted. */
void supine_patient_krige_errors(const supine_patient_krige *krige,
                                 double error[SUPINE_PATIENT_CONSTANTS]);

/* Predict a row's value, mm. Overwrites the fit's scratch space, so one thread at a time.
 * @param variance  written: variance of the prediction without noise, mm^2 */
double supine_patient_krige_predict(supine_patient_krige *krige, const supine_patient_row *row,
                                    double *variance);

/* Copy the law, its correction and the motion into a patient whose frame is set. */
void supine_patient_krige_take(const supine_patient_krige *krige, supine_patient *patient);

/* --- held-out error -------------------------------------------------------------------------- */

/** Predictions of the displacement: the baselines, the law, and the law with its correction. */
typedef enum supine_patient_score {
  SUPINE_PATIENT_SCORE_NONE,
  SUPINE_PATIENT_SCORE_TRANSLATION,
  SUPINE_PATIENT_SCORE_AFFINE,
  SUPINE_PATIENT_SCORE_LAW,
  SUPINE_PATIENT_SCORE_CORRECTED,
  SUPINE_PATIENT_SCORES
} supine_patient_score;

/** Result of a fit; errors are in mm RMS. */
typedef struct supine_patient_fit_report {
  double points;                          /**< number of landmarks, or of points of a surface */
  double blocks;                          /**< number of cubes of 40 mm with points in them */
  double fitted[SUPINE_PATIENT_SCORES];   /**< on the fitted points */
  double held_out[SUPINE_PATIENT_SCORES]; /**< on held-out blocks */
  double baseline;  /**< on held-out blocks: of a translation if the scans moved, else of none */
  double band;      /**< % of the held-out points within the 95 % band */
  double explained; /**< held-out share of the squared displacement that the law explains, % */
  double expected_point;                  /**< expected error of points in three dimensions */
  double expected_constant;               /**< its square for each mm of displacement, mm */
  double error[SUPINE_PATIENT_CONSTANTS]; /**< standard errors of c1 to c9 */
} supine_patient_fit_report;

/** Fit a law and its correction to rows, and measure its error on held-out blocks of 40 mm.
 * @param rows     [single + 3 triples]; their `block` is written
 * @param single   rows of points with one known component; they come first
 * @param triples  landmarks, three rows each
 * @param patient  in: the frame of the rows; out: the law and its correction
 * @retval SUPINE_ERROR_FORMAT     fewer points than the law has unknowns
 * @retval SUPINE_ERROR_NUMERICAL, SUPINE_ERROR_MEMORY */
supine_status supine_patient_fit(const supine_patient_fit_options *options,
                                 supine_patient_row *rows, size_t single, size_t triples,
                                 supine_patient *patient, supine_patient_fit_report *report,
                                 supine_error *error);

#endif
