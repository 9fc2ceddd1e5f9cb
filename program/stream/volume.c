/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Volumes over time: a breath sampled once, and volumes that people or sensors give. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/stream/volume.h"

supine_status supine_stream_volume_breathe(supine_stream_volume *volume, const supine_pv *pv,
                                           const supine_pv_breath *breath, supine_error *error) {
  enum { COUNT = SUPINE_STREAM_BREATH_SAMPLES + 1 };
  double times[COUNT];
  const double period = 60.0 / breath->rate;
  for (size_t i = 0; i < COUNT; ++i) {
    times[i] = period * (double)i / SUPINE_STREAM_BREATH_SAMPLES;
  }
  const supine_status status =
      supine_breath_evaluate(pv, breath, COUNT, times, volume->breath, NULL, error);
  if (status == SUPINE_OK) {
    volume->breath[COUNT - 1] = volume->breath[0]; /* the next breath's first */
    volume->breathes = true;
    volume->period = period;
  }
  return status;
}

supine_status supine_stream_volume_fix(supine_stream_volume *volume, const char *text,
                                       supine_error *error) {
  const bool rest = strncmp(text, "rest", 4) == 0;
  const bool full = strcmp(text, "full") == 0;
  const char *number = rest ? text + 4 : text;
  double value = 0.0;
  bool good = full || (rest && *number == '\0');
  if (!good && *number != '\0' && (!rest || *number == '+' || *number == '-')) {
    char *end = NULL;
    value = strtod(number, &end);
    good = end != number && *end == '\0' && isfinite(value);
  }
  if (!good) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a volume is rest, full, rest+ML, or mL from the reference, not '%s'",
                            text);
  }
  volume->breathes = false;
  volume->absolute = !rest;
  volume->fixed = value;
  return SUPINE_OK;
}

double supine_stream_volume_at(const supine_stream_volume *volume, const supine_basis *basis,
                               const double gravity[3], double time) {
  double rest = 0.0;
  (void)supine_basis_resting_volume(basis, gravity, &rest); /* fails for no unit direction */
  if (!volume->breathes) {
    return volume->absolute ? volume->fixed : rest + volume->fixed;
  }
  const double turns = time / volume->period;
  const double at = (turns - floor(turns)) * SUPINE_STREAM_BREATH_SAMPLES;
  const size_t i = (size_t)fmin(at, SUPINE_STREAM_BREATH_SAMPLES - 1);
  const double t = at - (double)i;
  return rest + (1.0 - t) * volume->breath[i] + t * volume->breath[i + 1];
}
