/* SPDX-License-Identifier: MIT */
/* Read the vertices and faces of a PLY file. A file shorter than its header says is refused. */
#include <stdlib.h>

#include "base/arena.h"
#include "base/ascii.h"

#include "mesh/io/read.h"

enum { ELEMENTS_MAX = 32, PROPERTIES_MAX = 256 };

typedef enum encoding { ASCII, LITTLE, BIG, ENCODINGS } encoding;
typedef enum kind { VERTICES, FACES, STRIPS, OTHER } kind;
/* Use of a property: a coordinate, the list of corners of a face, or none. */
typedef enum role { X, Y, Z, CORNERS, NONE } role;

typedef struct property {
  const mesh_type *count; /* type of the length of a list; NULL if the property is not a list */
  const mesh_type *type;
  role role;
} property;

typedef struct element {
  kind kind;
  uint64_t count;
  size_t first_property;
  size_t property_count;
} element;

typedef struct ply {
  const mesh_file *file;
  supine_error *error;
  encoding encoding;
  mesh_text text; /* part of the file not yet read */
  mesh_text line;
  /* bit 1 << role is set if an element with entries has a property of this role */
  unsigned present;
  size_t element_count;
  size_t property_count;
  element elements[ELEMENTS_MAX];
  property properties[PROPERTIES_MAX];
  mesh_faces faces;
} ply;

/* Return the index of a word in a list that ends with NULL, or the index of the NULL. */
static int find_name(mesh_text word, const char *const *names) {
  int index = 0;
  while (names[index] != NULL && !supine_io_text_is(word, names[index])) {
    ++index;
  }
  return index;
}

static bool add_element(ply *in, mesh_text name, mesh_text count) {
  static const char *const kinds[] = {"vertex", "face", "tristrips", NULL};
  if (in->element_count == ELEMENTS_MAX) {
    return false;
  }
  element *added = &in->elements[in->element_count];
  *added = (element){.kind = (kind)find_name(name, kinds), .first_property = in->property_count};
  if (added->kind != OTHER) {
    for (size_t e = 0; e < in->element_count; ++e) {
      if (in->elements[e].kind == added->kind) { /* two elements of the same kind are ambiguous */
        return false;
      }
    }
  }
  ++in->element_count;
  return supine_io_text_count(count, &added->count);
}

/* Add the property that the words after "property" describe. */
static bool add_property(ply *in, const mesh_text *word, size_t words) {
  static const char *const columns[] = {"x", "y", "z", NULL};
  static const char *const corners[] = {"vertex_indices", "vertex_index", NULL};
  const bool list = words > 0 && supine_io_text_is(word[0], "list");
  if (in->property_count == PROPERTIES_MAX || in->element_count == 0 || words < (list ? 4 : 2)) {
    return false;
  }
  element *of = &in->elements[in->element_count - 1];
  property *added = &in->properties[in->property_count++];
  const mesh_text name = word[list ? 3 : 1];
  *added = (property){.count = list ? supine_io_type_find(word[1]) : NULL,
                      .type = supine_io_type_find(word[list ? 2 : 0]),
                      .role = NONE};
  if (of->kind == VERTICES && !list) {
    const int column = find_name(name, columns);
    added->role = columns[column] != NULL ? (role)column : NONE;
  } else if (of->kind == FACES && list && corners[find_name(name, corners)] != NULL) {
    added->role = CORNERS;
  }
  ++of->property_count;
  in->present |= of->count > 0 ? 1U << added->role : 0U;
  return added->type != NULL && (!list || (added->count != NULL && !added->count->is_real));
}

/* Read one line of the header; skip comments and unknown keywords. */
static bool read_line(ply *in, mesh_text line, bool *has_format) {
  static const char *const encodings[] = {"ascii", "binary_little_endian", "binary_big_endian",
                                          NULL};
  mesh_text word[5];
  size_t words = 0;
  for (const unsigned char *at = line.at; at < line.end; ++at) {
    if (*at < ' ' && *at != '\t') {
      return false;
    }
  }
  while (words < 5 && supine_io_text_word(&line, &word[words])) {
    ++words;
  }
  if (words > 0 && supine_io_text_is(word[0], "format")) {
    in->encoding = words > 1 ? (encoding)find_name(word[1], encodings) : ENCODINGS;
    *has_format = in->encoding < ENCODINGS;
    return *has_format;
  }
  if (words > 0 && supine_io_text_is(word[0], "element")) {
    return words > 2 && add_element(in, word[1], word[2]);
  }
  if (words > 0 && supine_io_text_is(word[0], "property")) {
    return add_property(in, word + 1, words - 1);
  }
  return true;
}

static supine_status read_header(ply *in) {
  mesh_text line;
  bool has_format = false;
  const bool has_line = supine_io_text_line(&in->text, &line);
  SUPINE_REFUSE_IF(!has_line || !supine_io_text_is(line, "ply"), in->error, SUPINE_ERROR_FORMAT,
                   "%s: does not begin with \"ply\"; give a PLY file", in->file->path);
  for (size_t number = 2; supine_io_text_line(&in->text, &line); ++number) {
    mesh_text rest = line;
    mesh_text word;
    if (supine_io_text_word(&rest, &word) && supine_io_text_is(word, "end_header")) {
      SUPINE_REFUSE_IF(!has_format, in->error, SUPINE_ERROR_FORMAT,
                       "%s: the PLY header has no format line; save the mesh again",
                       in->file->path);
      return SUPINE_OK;
    }
    const bool good = read_line(in, line, &has_format);
    SUPINE_REFUSE_IF(!good, in->error, SUPINE_ERROR_FORMAT,
                     "%s: line %zu of the PLY header is malformed; save the mesh again",
                     in->file->path, number);
  }
  return supine_error_set(
      in->error, SUPINE_ERROR_FORMAT,
      "%s: the PLY header has no end_header: the file is truncated; save it again", in->file->path);
}

static supine_status check_header(const ply *in) {
  static const unsigned needed = 1U << X | 1U << Y | 1U << Z | 1U << CORNERS;
  const char *path = in->file->path;
  for (size_t e = 0; e < in->element_count; ++e) {
    SUPINE_REFUSE_IF(in->elements[e].property_count == 0, in->error, SUPINE_ERROR_FORMAT,
                     "%s: element %zu of the PLY header has no property; save the mesh again", path,
                     e + 1);
    SUPINE_REFUSE_IF(in->elements[e].kind == STRIPS && in->elements[e].count > 0, in->error,
                     SUPINE_ERROR_MESH,
                     "%s: it has strips of triangles; save the mesh as triangles", path);
  }
  if (in->encoding == ASCII) {
    SUPINE_TRY(supine_io_guard_text(in->file, in->error));
  }
  SUPINE_REFUSE_IF((in->present & needed) != needed, in->error, SUPINE_ERROR_MESH,
                   "%s: no triangles: the PLY header has no faces with vertex_indices, or no "
                   "vertices with x, y and z; save the mesh as triangles",
                   path);
  return SUPINE_OK;
}

/* Read the next number; return false if it is missing or malformed. */
static bool take(ply *in, const mesh_type *type, double *value) {
  if (in->encoding != ASCII) {
    if ((size_t)(in->text.end - in->text.at) < type->size) {
      return false;
    }
    *value = supine_io_type_decode(type, in->text.at, in->encoding == BIG);
    in->text.at += type->size;
    return true;
  }
  mesh_text word;
  uint64_t count = 0;
  if (type->is_real) {
    return supine_io_text_number(&in->line, value);
  }
  if (!supine_io_text_word(&in->line, &word)) {
    return false;
  }
  const bool negative = type->is_signed && *word.at == '-';
  word.at += negative;
  const bool good = supine_io_text_count(word, &count);
  *value = negative ? -(double)count : (double)count;
  return good;
}

static supine_status cut_short(const ply *in, const element *of, uint64_t item) {
  static const char *const names[] = {"vertex", "face", "tristrips", "item"};
  return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                          "%s: truncated or malformed at %s %llu (the PLY header says %llu in "
                          "all); save the mesh again",
                          in->file->path, names[of->kind], (unsigned long long)item,
                          (unsigned long long)of->count);
}

static supine_status take_list(ply *in, const element *of, uint64_t item, const property *list) {
  double corners[MESH_CORNERS_MAX];
  double length = 0.0;
  if (!take(in, list->count, &length)) {
    return cut_short(in, of, item);
  }
  SUPINE_REFUSE_IF(length < 0.0 || length > (double)in->file->size, in->error, SUPINE_ERROR_FORMAT,
                   "%s: a list has the impossible length %.0f; save the mesh again", in->file->path,
                   length);
  const uint64_t count = (uint64_t)length;
  for (uint64_t k = 0; k < count; ++k) {
    double value = 0.0;
    if (!take(in, list->type, &value)) {
      return cut_short(in, of, item);
    }
    if (k < MESH_CORNERS_MAX) {
      corners[k] = value;
    }
  }
  return list->role == CORNERS ? supine_io_faces_add(&in->faces, corners, (size_t)count, in->error)
                               : SUPINE_OK;
}

static supine_status take_items(ply *in, const element *of) {
  double *vertices = in->faces.mesh->vertices;
  for (uint64_t i = 0; i < of->count; ++i) {
    if (in->encoding == ASCII && !supine_io_text_line(&in->text, &in->line)) {
      return cut_short(in, of, i);
    }
    for (size_t p = 0; p < of->property_count; ++p) {
      const property *item = &in->properties[of->first_property + p];
      double value = 0.0;
      if (item->count != NULL) {
        SUPINE_TRY(take_list(in, of, i, item));
      } else if (!take(in, item->type, &value)) {
        return cut_short(in, of, i);
      } else if (item->role <= Z) {
        vertices[3 * i + item->role] = (double)(float)value;
      }
    }
  }
  return SUPINE_OK;
}

/* Allocate the vertices that the header announces, at most as many as the file can hold. */
static supine_status make_room(const ply *in, const element *of, supine_mesh *mesh) {
  uint64_t least = 0; /* smallest possible size of a vertex in the file, bytes */
  for (size_t p = 0; p < of->property_count; ++p) {
    const property *item = &in->properties[of->first_property + p];
    if (in->encoding == ASCII) {
      least += 2; /* at least a digit and a blank */
    } else {
      least += item->count != NULL ? item->count->size : item->type->size;
    }
  }
  const uint64_t room = (uint64_t)(in->text.end - in->text.at) / least + 1;
  const uint64_t count = of->count < room ? of->count : room;
  SUPINE_REFUSE_IF(count > MESH_VERTICES_MAX, in->error, SUPINE_ERROR_FORMAT,
                   "%s: more than %d vertices; give a coarser mesh", in->file->path,
                   MESH_VERTICES_MAX);
  mesh->vertex_count = (size_t)count;
  mesh->vertices = malloc((size_t)count * 3 * sizeof *mesh->vertices);
  return mesh->vertices == NULL
             ? supine_error_memory(in->error, "%zu vertices of %s", (size_t)count, in->file->path)
             : SUPINE_OK;
}

/* Refuse a file with more than the header counts: a part of the surface would be lost. Blanks, and
 * zeros, are padding. */
static supine_status check_end(const ply *in) {
  const unsigned char *at = in->text.at;
  while (at < in->text.end && (*at == '\0' || supine_ascii_is_space((char)*at))) {
    ++at;
  }
  SUPINE_REFUSE_IF(
      at < in->text.end, in->error, SUPINE_ERROR_FORMAT,
      "%s: %zu bytes follow what the PLY header counts: save the mesh again, so that no "
      "part of the surface is lost",
      in->file->path, (size_t)(in->text.end - at));
  return SUPINE_OK;
}

supine_status supine_io_read_ply(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                 supine_error *error) {
  ply in = {.file = file,
            .error = error,
            .text = {file->bytes, file->bytes + file->size},
            .faces = {.path = file->path, .mesh = mesh}};
  SUPINE_TRY(read_header(&in));
  SUPINE_TRY(check_header(&in));
  for (size_t e = 0; e < in.element_count; ++e) {
    const element *of = &in.elements[e];
    SUPINE_REFUSE_IF(of->kind == FACES && mesh->vertices == NULL, in.error, SUPINE_ERROR_FORMAT,
                     "%s: its faces come before its vertices; save the mesh again", in.file->path);
    if (of->kind == VERTICES) {
      SUPINE_TRY(make_room(&in, of, mesh));
    }
    SUPINE_TRY(take_items(&in, of));
  }
  SUPINE_TRY(check_end(&in));
  *dropped = in.faces.dropped;
  return SUPINE_OK;
}
