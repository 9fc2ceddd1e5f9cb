/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options that say where gravity points. */
#include <math.h>
#include <string.h>

#include <supine/posture.h>

#include "runtime/options/orientation.h"

int supine_options_orientation_posture(const char *command, const char *name, double gravity[3]) {
  enum { NAMES_MAX = 32 };
  if (supine_posture_gravity(name, gravity) == SUPINE_OK) {
    return SUPINE_EXIT_OK;
  }
  const char *names[NAMES_MAX];
  const size_t count = supine_posture_count() < NAMES_MAX ? supine_posture_count() : NAMES_MAX;
  for (size_t i = 0; i < count; ++i) {
    names[i] = supine_posture_name(i);
  }
  const char *nearest = supine_options_suggest(name, names, count);
  if (nearest != NULL) {
    return supine_options_usage(command, "no posture '%s'; did you mean '%s'?", name, nearest);
  }
  return supine_options_usage(command,
                              "no posture '%s': there are supine, prone, left, right, upright, "
                              "inverted and the DICOM patient positions",
                              name);
}

static int read_posture(const char *command, const char *value, void *field) {
  return supine_options_orientation_posture(command, value, field);
}

static int read_gravity(const char *command, const char *value, void *field) {
  double *g = field;
  if (!supine_options_parse_numbers(value, 3, g)) {
    return SUPINE_OPTION_MISFIT;
  }
  const double largest = fmax(fabs(g[0]), fmax(fabs(g[1]), fabs(g[2])));
  if (largest == 0.0) {
    return supine_options_usage(command, "gravity 0,0,0 has no direction; supine is 0,1,0");
  }
  const double x = g[0] / largest; /* so that no square overflows or vanishes */
  const double y = g[1] / largest;
  const double z = g[2] / largest;
  const double length = sqrt(x * x + y * y + z * z);
  if (fabs(length * largest - 1.0) > 1e-6) {
    supine_options_say(command, "note: gravity has length %g; only its direction counts",
                       length * largest);
  }
  g[0] = x / length;
  g[1] = y / length;
  g[2] = z / length;
  return SUPINE_EXIT_OK;
}

static int read_quaternion(const char *command, const char *value, void *field) {
  double q[4];
  (void)command;
  return supine_options_fits(supine_options_parse_numbers(value, 4, q) &&
                             supine_posture_quaternion(q, field) == SUPINE_OK);
}

#define GRAVITY                                                                                    \
  SUPINE_FILLS(supine_orientation, gravity), SUPINE_SAYS_GIVEN(supine_orientation, given),         \
      .rivals = "gravity"

const supine_option supine_options_orientation[] = {
    {.help = "Where gravity points (one of the first three):"},
    {"posture", 0, "NAME",
     "supine, prone, left, right (lying on that side), upright, inverted, or a DICOM patient "
     "position: HFS, FFS, HFP, FFP, HFDL, FFDL, HFDR, FFDR",
     GRAVITY, .read = read_posture},
    {"gravity", 0, "X,Y,Z",
     "a direction in body axes: x to the left, y to the back, z to the head; supine is 0,1,0",
     GRAVITY, .read = read_gravity, .wants = "three finite numbers, X,Y,Z"},
    {"quaternion", 0, "W,X,Y,Z",
     "rotation from body axes to a world whose z points up; 1,0,0,0 is upright", GRAVITY,
     .read = read_quaternion, .wants = "four finite numbers, W,X,Y,Z, not all 0"},
    {"tilt", 0, "DEGREES",
     "turns gravity in the sagittal plane from the back towards the head: from supine, 15 is "
     "Trendelenburg, head down",
     SUPINE_FILLS(supine_orientation, tilt), .wants = "degrees"},
    {.name = NULL}};

int supine_options_orientation_finish(const supine_orientation *orientation, const char *command,
                                      double gravity[3]) {
  if (!orientation->given && orientation->tilt == 0.0) {
    return supine_options_usage(command, "where does gravity point? Give --posture, for example");
  }
  static const double supine[3] = {0.0, 1.0, 0.0};
  (void)supine_posture_tilt(orientation->given ? orientation->gravity : supine, orientation->tilt,
                            gravity); /* both are finite */
  return SUPINE_EXIT_OK;
}
