/* SPDX-License-Identifier: MIT */
/* Read a PLY file's header. */

#include "mesh/io/ply.h"

static const ply_type *find_type(mesh_text word) {
  static const ply_type types[] = {
      {"char", 1, true, false},    {"int8", 1, true, false},    {"uchar", 1, false, false},
      {"uint8", 1, false, false},  {"short", 2, true, false},   {"int16", 2, true, false},
      {"ushort", 2, false, false}, {"uint16", 2, false, false}, {"int", 4, true, false},
      {"int32", 4, true, false},   {"uint", 4, false, false},   {"uint32", 4, false, false},
      {"float", 4, true, true},    {"float32", 4, true, true},  {"double", 8, true, true},
      {"float64", 8, true, true}};
  for (size_t i = 0; i < sizeof types / sizeof *types; ++i) {
    if (supine_mesh_text_is(word, types[i].name)) {
      return &types[i];
    }
  }
  return NULL;
}

/* Find the index of a word in a NULL-terminated list, or of the NULL if it is not there. */
static int find_name(mesh_text word, const char *const *names) {
  int index = 0;
  while (names[index] != NULL && !supine_mesh_text_is(word, names[index])) {
    ++index;
  }
  return index;
}

static ply_role find_role(mesh_text name, ply_kind kind, bool is_list) {
  static const char *const columns[] = {"x", "y", "z", NULL};
  static const char *const corners[] = {"vertex_indices", "vertex_index", NULL};
  const int index = find_name(name, is_list ? corners : columns);
  if (kind == PLY_VERTICES && !is_list) {
    return columns[index] == NULL ? PLY_NOTHING : (ply_role)index;
  }
  return kind == PLY_FACES && is_list && corners[index] != NULL ? PLY_CORNERS : PLY_NOTHING;
}

static bool read_format(mesh_text line, ply_header *header) {
  mesh_text word;
  if (!supine_mesh_text_word(&line, &word)) {
    return false;
  }
  header->encoding = supine_mesh_text_is(word, "ascii")                  ? PLY_ASCII
                     : supine_mesh_text_is(word, "binary_little_endian") ? PLY_LITTLE
                                                                         : PLY_BIG;
  return header->encoding != PLY_BIG || supine_mesh_text_is(word, "binary_big_endian");
}

static bool read_element(mesh_text line, ply_header *header) {
  static const char *const kinds[] = {"vertex", "face", "tristrips", NULL};
  mesh_text name;
  mesh_text count;
  if (header->element_count == PLY_ELEMENTS_MAX || !supine_mesh_text_word(&line, &name) ||
      !supine_mesh_text_word(&line, &count)) {
    return false;
  }
  ply_element *element = &header->elements[header->element_count];
  *element = (ply_element){.kind = (ply_kind)find_name(name, kinds),
                           .first_property = header->property_count};
  for (size_t e = 0; element->kind != PLY_OTHER && e < header->element_count; ++e) {
    if (header->elements[e].kind == element->kind) { /* a second one would be ambiguous */
      return false;
    }
  }
  ++header->element_count;
  return supine_mesh_text_count(count, &element->count);
}

static bool read_property(mesh_text line, ply_header *header) {
  mesh_text word;
  if (header->property_count == PLY_PROPERTIES_MAX || header->element_count == 0 ||
      !supine_mesh_text_word(&line, &word)) {
    return false;
  }
  ply_element *element = &header->elements[header->element_count - 1];
  ply_property property = {0};
  if (supine_mesh_text_is(word, "list")) {
    if (!supine_mesh_text_word(&line, &word)) {
      return false;
    }
    property.count = find_type(word);
    if (property.count == NULL || property.count->is_real || !supine_mesh_text_word(&line, &word)) {
      return false;
    }
  }
  property.type = find_type(word);
  if (property.type == NULL || !supine_mesh_text_word(&line, &word)) {
    return false;
  }
  property.role = find_role(word, element->kind, property.count != NULL);
  ++element->property_count;
  header->present |= element->count > 0 ? 1U << property.role : 0U;
  header->properties[header->property_count++] = property;
  return true;
}

static bool is_printable(mesh_text line) {
  for (; line.at < line.end; ++line.at) {
    if (*line.at < ' ' && *line.at != '\t') {
      return false;
    }
  }
  return true;
}

/* Read one line; skip comments and unknown keywords. */
static bool read_line(mesh_text line, ply_header *header, bool *has_format) {
  mesh_text word;
  if (!is_printable(line)) {
    return false;
  }
  if (!supine_mesh_text_word(&line, &word)) {
    return true;
  }
  if (supine_mesh_text_is(word, "format")) {
    *has_format = read_format(line, header);
    return *has_format;
  }
  return supine_mesh_text_is(word, "element")    ? read_element(line, header)
         : supine_mesh_text_is(word, "property") ? read_property(line, header)
                                                 : true;
}

supine_status supine_mesh_ply_header_read(const mesh_file *file, ply_header *header,
                                          supine_error *error) {
  *header = (ply_header){0};
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  bool has_format = false;
  if (!supine_mesh_text_line(&text, &line) || !supine_mesh_text_is(line, "ply")) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: does not begin with \"ply\"; give a PLY file", file->path);
  }
  for (size_t number = 2; supine_mesh_text_line(&text, &line); ++number) {
    mesh_text rest = line;
    mesh_text word;
    if (supine_mesh_text_word(&rest, &word) && supine_mesh_text_is(word, "end_header")) {
      header->size = (size_t)(text.at - file->bytes);
      return has_format ? SUPINE_OK
                        : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                           "%s: the PLY header has no format line", file->path);
    }
    if (!read_line(line, header, &has_format)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: line %zu of the PLY header is malformed", file->path, number);
    }
  }
  return supine_error_set(
      error, SUPINE_ERROR_FORMAT,
      "%s: the PLY header has no end_header: the file is truncated; save it again", file->path);
}
