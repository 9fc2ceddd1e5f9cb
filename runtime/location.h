/* SPDX-License-Identifier: MIT */
/** @file
 * The lungs that supine_locate found from observed points. */
#ifndef SUPINE_LOCATION_H
#define SUPINE_LOCATION_H

#include <supine/locate.h>

#include "runtime/expected.h"

/** The result of supine_locate. It lies at the start of the caller's work space. */
struct supine_location {
  supine_location_info info;
  supine_kriging kriging;
  supine_kriging_options options;
  /** Mean of the observed positions, minus the rotated mean of the predicted positions, mm. */
  double origin[3];
  double axis[3];   /**< direction that no view sees, in the frame of the observations; 0 if none */
  double deviation; /**< prior standard deviation of the volume, mL; 0 if the volume is known */
  double factor;    /**< factor on the expected errors, from the residuals of the points */
  double excess;    /**< variance that the residuals leave beyond the expected errors, mm^2 */
};

/** Vertices of one lung in the located lungs, in the frame of the basis. */
typedef struct supine_location_block {
  supine_expected_block formula;
  float law[3 * LOCATE_BLOCK], scan[3 * LOCATE_BLOCK]; /**< predicted without points, and scanned */
  float volume[3 * LOCATE_BLOCK]; /**< shift per prior standard deviation of the volume, mm */
  float size[LOCATE_BLOCK];       /**< length of the displacement from the scan, mm */
  float shift[3 * LOCATE_BLOCK], variance[LOCATE_BLOCK]; /**< of supine_kriging_predict */
} supine_location_block;

/** Evaluate vertices begin <= i < end of one lung, at most LOCATE_BLOCK.
 * @param model  for the state found, from the scan, with supine_location.deviation */
void supine_location_evaluate(const supine_location *found, const supine_expected_model *model,
                              size_t lung, size_t begin, size_t end, supine_location_block *block);

/** Return the squared error of vertex i of a block by all that the points show, mm^2: the variance
 * of kriging, limited to that without observations if at least three points were observed and no
 * rotation was fitted. For two points, this limit would be too small (0.85 of the true error). For
 * a fitted rotation, it would ignore the error of the rotation, and for lines of sight that along
 * the lines. */
double supine_location_square(const supine_location *found, const supine_location_block *block,
                              size_t i);

/** Move a point from the frame of the basis to that of the observations. */
void supine_location_move(const supine_location *found, const double at[3], double moved[3]);

/** Move points [count, 3], mm, likewise. */
void supine_location_move_all(const supine_location *found, size_t count, float *xyz);

/** Turn vectors [count, 3] likewise. */
void supine_location_turn_all(const supine_location *found, size_t count, float *vectors);

#endif
