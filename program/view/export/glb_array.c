/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Append arrays to a glTF file: accessors, buffer views and the binary chunk. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/view/export/glb.h"
#include "program/view/export/packed.h"

/* Format in which the file stores a kind of array. */
typedef struct layout {
  const char *type;
  size_t columns;
  size_t stride; /* bytes per element */
  int component; /* componentType of the accessor */
  int limit;     /* largest integer to store; 0 if the array is stored as it is in memory */
  int target;    /* `target` of the buffer view; 0 if it has none */
} layout;

static layout layout_of(const glb *g, glb_kind kind) {
  enum { BYTE = 5120, UNSIGNED_BYTE, SHORT, UNSIGNED_SHORT, UNSIGNED_INT = 5125, FLOAT };
  enum { VERTICES = 34962, CORNERS };
  const bool plain = g->options->plain;
  switch (kind) {
  case GLB_CORNERS:
    return (layout){"SCALAR", 1, 4, UNSIGNED_INT, 0, CORNERS};
  case GLB_TIMES:
    return (layout){"SCALAR", 1, 4, FLOAT, 0, 0};
  case GLB_WEIGHTS:
    return plain ? (layout){"SCALAR", 1, 4, FLOAT, 0, 0}
                 : (layout){"SCALAR", 1, 2, UNSIGNED_SHORT, UINT16_MAX, 0};
  case GLB_ROTATIONS:
    return (layout){"VEC4", 4, 16, FLOAT, 0, 0};
  case GLB_POSITIONS:
    return plain ? (layout){"VEC3", 3, 12, FLOAT, 0, VERTICES}
                 : (layout){"VEC3", 3, 8, SHORT, INT16_MAX, VERTICES};
  default: /* GLB_NORMALS, GLB_NORMAL_CHANGES */
    return plain ? (layout){"VEC3", 3, 12, FLOAT, 0, VERTICES}
                 : (layout){"VEC3", 3, 4, BYTE, INT8_MAX, VERTICES};
  }
}

/* Encode `count` elements, in the order `order`, as the file stores them. Return NULL if out of
 * memory; the caller frees the result. */
static unsigned char *encode(glb_kind kind, const layout *l, const void *elements,
                             const uint32_t *order, size_t count) {
  unsigned char *encoded = calloc(count + 1, l->stride);
  if (encoded != NULL) {
    for (size_t i = 0; i < count; ++i) {
      unsigned char *row = encoded + i * l->stride;
      const size_t from = order != NULL ? order[i] : i;
      const float *values = (const float *)elements + l->columns * from;
      if (l->limit == 0) {
        memcpy(row, (const unsigned char *)elements + from * l->stride, l->stride);
        continue;
      }
      if (kind == GLB_NORMALS) {
        supine_export_pack_direction(values, l->stride, row);
        continue;
      }
      for (size_t k = 0; k < l->columns; ++k) {
        const size_t bytes = l->stride / (l->columns == 3 ? 4 : 1);
        const double value = (double)values[k] * (kind == GLB_POSITIONS ? 1 : l->limit);
        const int32_t counts = (int32_t)rint(fmax(-l->limit, fmin(l->limit, value)));
        memcpy(row + k * bytes, &counts, bytes);
      }
    }
  }
  return encoded;
}

/* Write the elements that encode() has returned, and return their buffer view. `mode` is the mode
 * of EXT_meshopt_compression, or NULL for no compression. */
static json_t *write_encoded(glb *g, glb_kind kind, const layout *l, const unsigned char *encoded,
                             size_t count, const char *mode) {
  const size_t bytes = count * l->stride;
  const json_int_t begin = (json_int_t)ftell(g->numbers);
  if (mode == NULL) {
    (void)fwrite(encoded, 1, bytes, g->numbers);
    (void)fwrite("\0\0\0", 1, -bytes % 4, g->numbers);
    return json_pack("{s:i, s:I, s:I}", "buffer", 0, "byteOffset", begin, "byteLength",
                     (json_int_t)bytes);
  }
  size_t size = 0;
  SUPINE_ARENA arena = {0};
  const void *packed =
      kind == GLB_CORNERS
          ? supine_export_pack_corners(&arena, (const uint32_t *)encoded, count, count, &size)
          : supine_export_pack_rows(&arena, encoded, count, l->stride, &size);
  if (packed == NULL) {
    g->status = SUPINE_ERROR_MEMORY;
    return NULL;
  }
  (void)fwrite(packed, 1, size, g->numbers);
  (void)fwrite("\0\0\0", 1, -size % 4, g->numbers);
  json_t *extension = json_pack("{s:i, s:I, s:I, s:I, s:I, s:s}", "buffer", 0, "byteOffset", begin,
                                "byteLength", (json_int_t)size, "byteStride", (json_int_t)l->stride,
                                "count", (json_int_t)count, "mode", mode);
  if (kind == GLB_NORMALS) {
    (void)json_object_set_new(extension, "filter", json_string("OCTAHEDRAL"));
  }
  json_t *view = json_pack("{s:i, s:I, s:I, s:{s:o}}", "buffer", 1, "byteOffset",
                           (json_int_t)g->unpacked, "byteLength", (json_int_t)bytes, "extensions",
                           "EXT_meshopt_compression", extension);
  g->unpacked += bytes;
  return view;
}

/* Set `min` and `max` of an accessor to the extremes of each component of the encoded elements. */
static void set_bounds(json_t *accessor, const layout *l, const unsigned char *encoded,
                       size_t count) {
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (size_t i = 0; i < count * l->columns; ++i) {
    const size_t axis = i % l->columns;
    const unsigned char *row = encoded + i / l->columns * l->stride;
    const double x =
        l->limit == 0 ? (double)((const float *)row)[axis] : (double)((const int16_t *)row)[axis];
    low[axis] = fmin(low[axis], x);
    high[axis] = fmax(high[axis], x);
  }
  (void)json_object_set_new(accessor, "min", supine_options_json_numbers(l->columns, low));
  (void)json_object_set_new(accessor, "max", supine_options_json_numbers(l->columns, high));
}

json_int_t supine_export_glb_put_zeros(glb *g, glb_kind kind, size_t count) {
  const layout l = layout_of(g, kind);
  (void)json_array_append_new(g->accessors,
                              json_pack("{s:i, s:I, s:s}", "componentType", l.component, "count",
                                        (json_int_t)count, "type", l.type));
  const size_t at = json_array_size(g->accessors) - 1;
  if (l.limit != 0 && kind != GLB_POSITIONS) {
    (void)json_object_set_new(json_array_get(g->accessors, at), "normalized", json_true());
  }
  return (json_int_t)at;
}

json_int_t supine_export_glb_put(glb *g, glb_kind kind, const void *elements, const uint32_t *order,
                                 size_t count) {
  const layout l = layout_of(g, kind);
  unsigned char *encoded = encode(kind, &l, elements, order, count);
  if (encoded == NULL) {
    g->status = SUPINE_ERROR_MEMORY;
    return 0;
  }
  const char *mode = NULL; /* of the compression by meshoptimizer */
  if (!g->options->plain && l.target != 0) {
    mode = kind == GLB_CORNERS ? "TRIANGLES" : "ATTRIBUTES";
  }
  json_t *view = write_encoded(g, kind, &l, encoded, count, mode);
  if (l.target != 0) {
    (void)json_object_set_new(view, "target", json_integer(l.target));
  }
  if (l.limit != 0 && l.target != 0) {
    (void)json_object_set_new(view, "byteStride", json_integer((json_int_t)l.stride));
  }
  const json_int_t at = supine_export_glb_put_zeros(g, kind, count);
  json_t *accessor = json_array_get(g->accessors, (size_t)at);
  (void)json_object_set_new(accessor, "bufferView",
                            json_integer((json_int_t)json_array_size(g->views)));
  if (kind == GLB_POSITIONS || kind == GLB_TIMES) {
    set_bounds(accessor, &l, encoded, count);
  }
  (void)json_array_append_new(g->views, view);
  free(encoded);
  return at;
}
