/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options that say where gravity points. */
#include <math.h>
#include <string.h>

#include <supine/posture.h>

#include "runtime/options/orientation.h"

const char supine_options_orientation_help[] =
    "Where gravity points (one of the first three):\n"
    "  --posture NAME       supine, prone, left, right (lying on that side), upright, inverted, "
    "or\n"
    "                       a DICOM patient position: HFS, FFS, HFP, FFP, HFDL, FFDL, HFDR, FFDR\n"
    "  --gravity X,Y,Z      a direction in body axes: x to the left, y to the back, z to the "
    "head;\n"
    "                       supine is 0,1,0\n"
    "  --quaternion W,X,Y,Z rotation from body axes to a world whose z points up; 1,0,0,0 is "
    "upright\n"
    "  --tilt DEGREES       turns gravity in the sagittal plane from the back towards the head:\n"
    "                       from supine, 15 is Trendelenburg, head down\n";

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

static int take_gravity(supine_orientation *orientation, const char *command, const char *value) {
  double *g = orientation->gravity;
  if (!supine_options_parse_numbers(value, 3, g)) {
    return supine_options_usage(command, "--gravity takes three finite numbers, X,Y,Z, not '%s'",
                                value);
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

int supine_options_orientation_take(supine_orientation *orientation, const char *command,
                                    int option, const char *value) {
  if (option == OPTION_TILT) {
    if (!supine_options_parse_number(value, &orientation->tilt)) {
      return supine_options_usage(command, "--tilt takes degrees, not '%s'", value);
    }
    return SUPINE_EXIT_OK;
  }
  if (orientation->given) {
    return supine_options_usage(command, "give one of --posture, --gravity and --quaternion");
  }
  orientation->given = true;
  if (option == OPTION_POSTURE) {
    return supine_options_orientation_posture(command, value, orientation->gravity);
  }
  if (option == OPTION_GRAVITY) {
    return take_gravity(orientation, command, value);
  }
  double q[4];
  if (!supine_options_parse_numbers(value, 4, q) ||
      supine_posture_quaternion(q, orientation->gravity) != SUPINE_OK) {
    return supine_options_usage(
        command, "--quaternion takes four finite numbers, W,X,Y,Z, not all 0; not '%s'", value);
  }
  return SUPINE_EXIT_OK;
}

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
