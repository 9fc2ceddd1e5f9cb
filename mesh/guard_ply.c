/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Is a PLY file's header legal, and does its body hold what the header promises? */
#include <string.h>

#include "internal.h"

enum { ELEMENTS_MAX = 32, PROPERTIES_MAX = 256 };

typedef enum ply_encoding { PLY_ASCII, PLY_LITTLE, PLY_BIG } ply_encoding;

typedef struct ply_type {
  const char *name;
  unsigned size;  /* bytes */
  bool is_signed; /* integers alone */
  bool is_real;
} ply_type;

typedef struct ply_property {
  const ply_type *count; /* NULL: not a list */
  const ply_type *type;
} ply_property;

typedef struct ply_element {
  uint64_t count;
  size_t first_property;
  size_t property_count;
  bool has_list;
} ply_element;

typedef struct ply_header {
  ply_encoding encoding;
  size_t element_count;
  size_t property_count;
  size_t vertex_element; /* ELEMENTS_MAX where there is none */
  size_t face_element;
  unsigned coordinates; /* x, y, z as bits 1, 2, 4 */
  bool has_corners;     /* the faces have a list of vertices */
  ply_element elements[ELEMENTS_MAX];
  ply_property properties[PROPERTIES_MAX];
} ply_header;

static const ply_type *find_type(mesh_text word) {
  static const ply_type types[] = {
      {"char", 1, true, false},    {"int8", 1, true, false},    {"uchar", 1, false, false},
      {"uint8", 1, false, false},  {"short", 2, true, false},   {"int16", 2, true, false},
      {"ushort", 2, false, false}, {"uint16", 2, false, false}, {"int", 4, true, false},
      {"int32", 4, true, false},   {"uint", 4, false, false},   {"uint32", 4, false, false},
      {"float", 4, true, true},    {"float32", 4, true, true},  {"double", 8, true, true},
      {"float64", 8, true, true}};
  for (size_t i = 0; i < sizeof types / sizeof *types; ++i) {
    if (mesh_text_is(word, types[i].name)) {
      return &types[i];
    }
  }
  return NULL;
}

static bool read_format(mesh_text line, ply_header *header) {
  mesh_text word;
  if (!mesh_text_word(&line, &word)) {
    return false;
  }
  header->encoding = mesh_text_is(word, "ascii")                  ? PLY_ASCII
                     : mesh_text_is(word, "binary_little_endian") ? PLY_LITTLE
                                                                  : PLY_BIG;
  return header->encoding != PLY_BIG || mesh_text_is(word, "binary_big_endian");
}

static bool read_element(mesh_text line, ply_header *header) {
  mesh_text name;
  mesh_text count;
  if (header->element_count == ELEMENTS_MAX || !mesh_text_word(&line, &name) ||
      !mesh_text_word(&line, &count)) {
    return false;
  }
  ply_element *element = &header->elements[header->element_count];
  *element = (ply_element){.first_property = header->property_count};
  if (mesh_text_is(name, "vertex")) {
    header->vertex_element = header->element_count;
  } else if (mesh_text_is(name, "face")) {
    header->face_element = header->element_count;
  }
  ++header->element_count;
  return mesh_text_count(count, &element->count);
}

static void note_name(mesh_text name, const ply_property *property, ply_header *header) {
  const size_t element = header->element_count - 1;
  if (element == header->vertex_element && property->count == NULL) {
    header->coordinates |= mesh_text_is(name, "x")   ? 1
                           : mesh_text_is(name, "y") ? 2
                           : mesh_text_is(name, "z") ? 4
                                                     : 0;
  } else if (element == header->face_element && property->count != NULL) {
    header->has_corners = header->has_corners || mesh_text_is(name, "vertex_indices") ||
                          mesh_text_is(name, "vertex_index");
  }
}

static bool read_property(mesh_text line, ply_header *header) {
  mesh_text word;
  if (header->property_count == PROPERTIES_MAX || header->element_count == 0 ||
      !mesh_text_word(&line, &word)) {
    return false;
  }
  ply_property property = {0};
  if (mesh_text_is(word, "list")) {
    if (!mesh_text_word(&line, &word)) {
      return false;
    }
    property.count = find_type(word);
    if (property.count == NULL || property.count->is_real || !mesh_text_word(&line, &word)) {
      return false;
    }
  }
  property.type = find_type(word);
  if (property.type == NULL || !mesh_text_word(&line, &word)) {
    return false;
  }
  note_name(word, &property, header);
  ply_element *element = &header->elements[header->element_count - 1];
  ++element->property_count;
  element->has_list = element->has_list || property.count != NULL;
  header->properties[header->property_count++] = property;
  return true;
}

/* Control bytes in a header are what importers stumble over. */
static bool is_printable(mesh_text line) {
  for (; line.at < line.end; ++line.at) {
    if (*line.at < ' ' && *line.at != '\t') {
      return false;
    }
  }
  return true;
}

static supine_status read_header(mesh_file *file, mesh_text *text, ply_header *header,
                                 supine_error *error) {
  *header = (ply_header){.vertex_element = ELEMENTS_MAX, .face_element = ELEMENTS_MAX};
  mesh_text line;
  mesh_text word;
  bool has_format = false;
  for (size_t number = 1; mesh_text_line(text, &line); ++number) {
    mesh_text rest = line;
    bool legal = is_printable(line);
    if (number == 1) {
      legal =
          legal && mesh_text_word(&rest, &word) && word.at == line.at && mesh_text_is(word, "ply");
    } else if (legal && mesh_text_word(&rest, &word)) {
      if (mesh_text_is(word, "end_header")) {
        file->head = (size_t)(text->at - file->bytes);
        return has_format ? SUPINE_OK
                          : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                             "%s: the PLY header has no format line", file->path);
      }
      if (mesh_text_is(word, "format")) {
        legal = has_format = read_format(rest, header);
      } else if (mesh_text_is(word, "element")) {
        legal = read_element(rest, header);
      } else if (mesh_text_is(word, "property")) {
        legal = read_property(rest, header);
      } else {
        legal = mesh_text_is(word, "comment") || mesh_text_is(word, "obj_info");
      }
    }
    if (!legal) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              number == 1 ? "%s: line %zu is not a PLY file's \"ply\""
                                          : "%s: line %zu of the PLY header is malformed",
                              file->path, number);
    }
  }
  return supine_error_set(error, SUPINE_ERROR_FORMAT,
                          "%s: the PLY header has no end_header: the file is truncated",
                          file->path);
}

/* A list's length; false where negative. */
static bool read_length(const unsigned char *at, const ply_type *type, ply_encoding encoding,
                        uint64_t *length) {
  *length = 0;
  for (unsigned k = 0; k < type->size; ++k) {
    const unsigned place = encoding == PLY_LITTLE ? k : type->size - 1 - k;
    *length |= (uint64_t)at[k] << (8 * place);
  }
  return !type->is_signed || (*length >> (8 * type->size - 1)) == 0;
}

static bool skip_bytes(mesh_text *text, uint64_t count, uint64_t size) {
  const uint64_t left = (uint64_t)(text->end - text->at);
  if (count != 0 && size > left / count) {
    return false;
  }
  text->at += count * size;
  return true;
}

static bool skip_binary_item(mesh_text *text, const ply_header *header,
                             const ply_element *element) {
  for (size_t p = 0; p < element->property_count; ++p) {
    const ply_property *property = &header->properties[element->first_property + p];
    uint64_t length = 1;
    if (property->count != NULL) {
      const unsigned char *at = text->at;
      if (!skip_bytes(text, 1, property->count->size) ||
          !read_length(at, property->count, header->encoding, &length)) {
        return false;
      }
    }
    if (!skip_bytes(text, length, property->type->size)) {
      return false;
    }
  }
  return true;
}

static bool skip_ascii_item(mesh_text *text, const ply_header *header, const ply_element *element) {
  mesh_text line = {text->at, text->at};
  while (line.at == line.end) { /* importers skip empty lines */
    if (!mesh_text_line(text, &line)) {
      return false;
    }
  }
  for (size_t p = 0; p < element->property_count; ++p) {
    uint64_t length = 1;
    mesh_text word;
    if (header->properties[element->first_property + p].count != NULL &&
        (!mesh_text_word(&line, &word) || !mesh_text_count(word, &length))) {
      return false;
    }
    if (!mesh_text_skip_numbers(&line, length)) {
      return false;
    }
  }
  return true;
}

/* The first item that is cut short or illegal; the element's count where there is none. */
static uint64_t skip_element(mesh_text *text, const ply_header *header,
                             const ply_element *element) {
  if (header->encoding != PLY_ASCII && !element->has_list) {
    uint64_t size = 0;
    for (size_t p = 0; p < element->property_count; ++p) {
      size += header->properties[element->first_property + p].type->size;
    }
    const uint64_t left = (uint64_t)(text->end - text->at);
    return skip_bytes(text, element->count, size) ? element->count : left / size;
  }
  for (uint64_t i = 0; i < element->count; ++i) {
    if (header->encoding == PLY_ASCII ? !skip_ascii_item(text, header, element)
                                      : !skip_binary_item(text, header, element)) {
      return i;
    }
  }
  return element->count;
}

supine_status mesh_guard_ply(mesh_file *file, supine_error *error) {
  mesh_text text = {file->bytes, file->bytes + file->size};
  ply_header header;
  const supine_status status = read_header(file, &text, &header, error);
  if (status != SUPINE_OK) {
    return status;
  }
  for (size_t e = 0; e < header.element_count; ++e) {
    const ply_element *element = &header.elements[e];
    if (element->property_count == 0) { /* would take no bytes, whatever the count */
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: element %zu of the PLY header has no property", file->path,
                              e + 1);
    }
    const uint64_t whole = skip_element(&text, &header, element);
    if (whole < element->count) {
      return supine_error_set(
          error, SUPINE_ERROR_FORMAT,
          "%s: truncated or malformed: %s %llu of %llu that the PLY header promises", file->path,
          e == header.vertex_element ? "vertex"
          : e == header.face_element ? "face"
                                     : "item",
          (unsigned long long)whole, (unsigned long long)element->count);
    }
  }
  file->whole = header.vertex_element < ELEMENTS_MAX && header.face_element < ELEMENTS_MAX &&
                header.coordinates == 7 && header.has_corners &&
                header.elements[header.vertex_element].count > 0 &&
                header.elements[header.face_element].count > 0;
  return SUPINE_OK;
}
