/* SPDX-License-Identifier: MIT */
/** @file
 * The lungs that supine_locate found from observed points. */
#ifndef SUPINE_LOCATION_H
#define SUPINE_LOCATION_H

#include <supine/locate.h>

#include "runtime/kriging.h"

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

#endif
