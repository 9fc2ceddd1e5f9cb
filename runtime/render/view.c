/* SPDX-License-Identifier: MIT */
/* Where viewers stand, in body axes (LPS). */
#include <string.h>

#include "render.h"

static const struct {
  const char *name;
  double axes[3][3]; /* right, up, towards the viewer */
} views[SUPINE_VIEW_COUNT] = {
    {"anterior", {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}},
    {"posterior", {{-1, 0, 0}, {0, 0, 1}, {0, 1, 0}}},
    {"left", {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}},
    {"right", {{0, -1, 0}, {0, 0, 1}, {-1, 0, 0}}},
    {"head", {{-1, 0, 0}, {0, -1, 0}, {0, 0, 1}}},
    {"feet", {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}},
    /* 35 degrees to the left, 18 up */
    {"oblique",
     {{0.819152044288992, 0.573576436351046, 0},
      {-0.177244886562898, 0.253132020158986, 0.951056516295154},
      {0.545504668015459, -0.779059888283094, 0.309016994374947}}},
};

const char *supine_view_name(supine_view view) {
  return view < SUPINE_VIEW_COUNT ? views[view].name : NULL;
}

void supine_view_axes(supine_view view, double axes[3][3]) {
  memcpy(axes, views[view].axes, sizeof views[view].axes);
}
