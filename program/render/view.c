/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The views' rotations from body axes (LPS). */
#include <string.h>

#include "program/render/render.h"

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
     {{0.8191520442889918, 0.57357643635104605, 0},
      {-0.17724486640549356, 0.25313190266227803, 0.95105651629515353},
      {0.54550360738501469, -0.77905988955754191, 0.3090169943749474}}},
};

const char *supine_render_view_name(supine_view view) {
  return view < SUPINE_VIEW_COUNT ? views[view].name : NULL;
}

void supine_render_view_axes(supine_view view, double axes[3][3]) {
  memcpy(axes, views[view].axes, sizeof views[view].axes);
}
