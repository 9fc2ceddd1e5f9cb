/* SPDX-License-Identifier: MIT */
/* Read glTF by assimp, once the numbers of its surface are known to be where the file states them.
 * assimp takes a negative offset for zero, and loses triangles that an accessor does not count. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include <jansson.h>

#include "base/arena.h"
#include "base/locale.h"

#include "mesh/io/read.h"

/* Bytes to which buffer views are padded. */
enum { PADDING = 4 };
/* Numbers by which glTF names what it holds. */
enum { TYPE_FLOAT = 5126, MODE_TRIANGLES = 4 };

typedef struct gltf {
  const char *path;
  const json_t *root;
  supine_error *error;
} gltf;

/* Parse the text of a file, or of the first chunk of a binary one; NULL if it is malformed. */
static json_t *parse(const mesh_file *file, json_error_t *why) {
  enum { HEADER = 20, CHUNK = 12 };
  const unsigned char *text = file->bytes;
  size_t size = file->size;
  if (size >= HEADER && memcmp(text, "glTF", 4) == 0) {
    size = supine_io_little_endian(text + CHUNK, 4);
    text += HEADER;
    if (size > file->size - HEADER) {
      return NULL;
    }
  }
  SUPINE_C_LOCALE;
  return json_loadb((const char *)text, size, JSON_DISABLE_EOF_CHECK, why);
}

/* Return a count in an object, `otherwise` if it is missing, or -1 if it is none. */
static int64_t count_of(const json_t *object, const char *name, int64_t otherwise) {
  const json_t *value = json_object_get(object, name);
  if (value == NULL) {
    return otherwise;
  }
  const int64_t count = json_is_integer(value) ? json_integer_value(value) : -1;
  return count >= 0 && count <= INT32_MAX ? count : -1;
}

/* Return the element of a list that a member of an object names; NULL if there is none. */
static const json_t *element_of(const gltf *g, const char *list, const json_t *object,
                                const char *member) {
  const int64_t index = count_of(object, member, -1);
  return index < 0 ? NULL : json_array_get(json_object_get(g->root, list), (size_t)index);
}

/* Return how many accessors read the buffer view that an accessor reads. */
static size_t count_readers(const gltf *g, const json_t *accessor) {
  const json_t *list = json_object_get(g->root, "accessors");
  const int64_t view = count_of(accessor, "bufferView", -1);
  size_t readers = 0;
  for (size_t i = 0; i < json_array_size(list); ++i) {
    readers += count_of(json_array_get(list, i), "bufferView", -1) == view ? 1 : 0;
  }
  return readers;
}

/* Check that an accessor reads what its buffer view holds, not less and not more.
 * @param size  of an element, bytes */
static supine_status check_room(const gltf *g, const char *name, const json_t *accessor,
                                int64_t size) {
  const json_t *view = element_of(g, "bufferViews", accessor, "bufferView");
  if (view == NULL) { /* assimp refuses the file, unless other numbers replace all of these */
    return SUPINE_OK;
  }
  const int64_t count = count_of(accessor, "count", -1);
  const int64_t offset = count_of(accessor, "byteOffset", 0);
  const int64_t stride = count_of(view, "byteStride", size);
  const int64_t length = count_of(view, "byteLength", -1);
  const int64_t begin = count_of(view, "byteOffset", 0);
  SUPINE_REFUSE_IF(count < 1 || offset < 0 || stride < size || length < 0 || begin < 0, g->error,
                   SUPINE_ERROR_FORMAT,
                   "%s: the accessor of its %s or their buffer view has a count, an offset or a "
                   "length that is impossible; save the mesh as PLY",
                   g->path, name);
  const int64_t held = length - offset < size ? 0 : 1 + (length - offset - size) / stride;
  const int64_t left = length - offset - (count - 1) * stride - size;
  if (held < count || (left >= PADDING && count_readers(g, accessor) == 1)) {
    return supine_io_compare_counts(g->path, (uint64_t)count, (uint64_t)held, name, g->error);
  }
  return SUPINE_OK;
}

/* Return the size of an index, bytes; 0 if its type is none of glTF. */
static int64_t size_of_index(int64_t type) {
  switch (type) {
  case 5121:
    return 1;
  case 5123:
    return 2;
  case 5125:
    return 4;
  default:
    return 0;
  }
}

/* Check the positions and corners of a part of a surface. */
static supine_status check_primitive(const gltf *g, const json_t *primitive) {
  const json_t *attributes = json_object_get(primitive, "attributes");
  const json_t *positions = element_of(g, "accessors", attributes, "POSITION");
  const json_t *corners = element_of(g, "accessors", primitive, "indices");
  if (positions == NULL) {
    return SUPINE_OK;
  }
  const char *kind = json_string_value(json_object_get(positions, "type"));
  const int64_t type = count_of(positions, "componentType", -1);
  SUPINE_REFUSE_IF(type != TYPE_FLOAT || kind == NULL || strcmp(kind, "VEC3") != 0, g->error,
                   SUPINE_ERROR_FORMAT,
                   "%s: its positions are not three numbers of single precision, which alone are "
                   "read; save the mesh as PLY",
                   g->path);
  SUPINE_TRY(check_room(g, "positions", positions, 3 * (int64_t)sizeof(float)));
  const int64_t size = size_of_index(count_of(corners, "componentType", -1));
  if (size > 0) {
    SUPINE_TRY(check_room(g, "corners", corners, size));
  }
  const int64_t count = count_of(corners != NULL ? corners : positions, "count", 0);
  const int64_t mode = count_of(primitive, "mode", MODE_TRIANGLES);
  SUPINE_REFUSE_IF(mode == MODE_TRIANGLES && count % 3 != 0, g->error, SUPINE_ERROR_FORMAT,
                   "%s: its triangles have %" PRId64 " corners, which is no multiple of three: "
                   "save it again, so that no part of the surface is lost",
                   g->path, count);
  return SUPINE_OK;
}

supine_status supine_io_read_gltf(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                  supine_error *error) {
  json_error_t why = {0};
  json_auto_t *root = parse(file, &why);
  if (root == NULL && json_error_code(&why) == json_error_out_of_memory) {
    return supine_error_memory(error, "%s", file->path);
  }
  const gltf g = {file->path, root, error};
  const json_t *meshes = json_object_get(root, "meshes");
  for (size_t i = 0; i < json_array_size(meshes); ++i) {
    const json_t *parts = json_object_get(json_array_get(meshes, i), "primitives");
    for (size_t k = 0; k < json_array_size(parts); ++k) {
      SUPINE_TRY(check_primitive(&g, json_array_get(parts, k)));
    }
  }
  return supine_io_import(file, mesh, dropped, error); /* which refuses malformed texts */
}
