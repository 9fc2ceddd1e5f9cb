/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What a glTF file's buffer will hold, in order. */
#include <math.h>

#include "program/export/glb.h"

enum { SHORT_STRIDE = 8 };

json_t *supine_export_glb_numbers(const double *values, size_t count) {
  json_t *array = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(array, json_real(values[i]));
  }
  return array;
}

/* Eight parameters: an accessor's properties in the terms of glTF. */
size_t supine_export_glb_plan_add(glb_plan *plan, int component, const char *type, size_t count,
                                  int target, size_t axes, const double *low, const double *high) {
  const size_t size = component == GLTF_SHORT ? SHORT_STRIDE : 4 * axes;
  const json_int_t length = (json_int_t)count * (json_int_t)size;
  json_t *view = json_pack("{s:i, s:I, s:I}", "buffer", 0, "byteOffset", (json_int_t)plan->bytes,
                           "byteLength", length);
  if (target != GLTF_NO_TARGET) {
    (void)json_object_set_new(view, "target", json_integer(target));
  }
  if (component == GLTF_SHORT) {
    (void)json_object_set_new(view, "byteStride", json_integer(SHORT_STRIDE));
  }
  json_t *accessor =
      json_pack("{s:I, s:i, s:I, s:s}", "bufferView", (json_int_t)json_array_size(plan->views),
                "componentType", component, "count", (json_int_t)count, "type", type);
  if (low != NULL && high != NULL) {
    (void)json_object_set_new(accessor, "min", supine_export_glb_numbers(low, axes));
    (void)json_object_set_new(accessor, "max", supine_export_glb_numbers(high, axes));
  }
  (void)json_array_append_new(plan->views, view);
  (void)json_array_append_new(plan->accessors, accessor);
  plan->bytes += count * size;
  return json_array_size(plan->accessors) - 1;
}

void supine_export_glb_bounds(const float *xyz, size_t count, bool rounded, double low[3],
                              double high[3]) {
  for (size_t axis = 0; axis < 3; ++axis) {
    low[axis] = INFINITY;
    high[axis] = -INFINITY;
    for (size_t i = 0; i < count; ++i) {
      const double x = (double)xyz[3 * i + axis];
      low[axis] = fmin(low[axis], rounded ? rint(x) : x);
      high[axis] = fmax(high[axis], rounded ? rint(x) : x);
    }
  }
}
