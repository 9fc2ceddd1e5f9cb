/* SPDX-License-Identifier: MIT */
/* Find the unit that a file of a surface states. */
#include <string.h>

#define ZLIB_CONST /* makes zlib declare next_in const */
#include <zlib.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/number.h"
#include "base/text.h"

#include "mesh/io/read.h"

/* Find the entry of the model in the directory of a 3MF file, which is a ZIP archive; NULL if it
 * has none. */
static const unsigned char *find_model(const mesh_file *file) {
  static const char name[] = "3D/3dmodel.model";
  enum { ENTRY = 46, LENGTH = sizeof name - 1 };
  const unsigned char *end = file->bytes + file->size;
  const unsigned char *at = file->bytes;
  while (at != NULL && (size_t)(end - at) >= ENTRY + LENGTH) {
    if (memcmp(at, "PK\1\2", 4) == 0 && memcmp(at + ENTRY, name, LENGTH) == 0) {
      return at;
    }
    at = memchr(at + 1, 'P', (size_t)(end - at - 1));
  }
  return NULL;
}

/* Unpack the first bytes of the model of a 3MF file; return their number, 0 if it has none. */
static size_t unpack_model(const mesh_file *file, char *head, size_t size) {
  enum { METHOD = 10, PACKED = 20, OFFSET = 42, LOCAL = 30, NAME = 26, EXTRA = 28, STORED = 0 };
  const unsigned char *entry = find_model(file);
  const size_t offset = entry != NULL ? supine_io_little_endian(entry + OFFSET, 4) : file->size;
  if (offset >= file->size || file->size - offset < LOCAL) {
    return 0;
  }
  const unsigned char *local = file->bytes + offset;
  const size_t begin =
      LOCAL + supine_io_little_endian(local + NAME, 2) + supine_io_little_endian(local + EXTRA, 2);
  const size_t packed = supine_io_little_endian(entry + PACKED, 4);
  if (begin > file->size - offset || packed > file->size - offset - begin) {
    return 0;
  }
  if (supine_io_little_endian(entry + METHOD, 2) == STORED) {
    const size_t taken = packed < size ? packed : size;
    memcpy(head, local + begin, taken);
    return taken;
  }
  z_stream z = {.next_in = local + begin,
                .avail_in = (unsigned)packed,
                .next_out = (unsigned char *)head,
                .avail_out = (unsigned)size};
  if (inflateInit2(&z, -MAX_WBITS) != Z_OK) {
    return 0;
  }
  (void)inflate(&z, Z_SYNC_FLUSH);
  (void)inflateEnd(&z);
  return size - z.avail_out;
}

/* Set the unit that a file names; "" if it names none. */
static supine_status take_name(mesh_file *file, const char *unit, supine_error *error) {
  static const struct {
    const char *name;
    double millimetres;
  } names[] = {{"millimeter", 1.0}, {"inch", 25.4},   {"feet", 304.8},     {"foot", 304.8},
               {"meter", 1000.0},   {"micron", 1e-3}, {"centimeter", 10.0}};
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    if (supine_ascii_same(unit, names[i].name)) {
      file->millimetres = names[i].millimetres;
    }
  }
  SUPINE_REFUSE_IF(unit[0] != '\0' && file->millimetres == 0.0, error, SUPINE_ERROR_FORMAT,
                   "%s: the unit \"%s\" is unknown; save the mesh in millimeter", file->path, unit);
  return SUPINE_OK;
}

/* Copy the value of an attribute of the first element `tag` of a text; "" if it has none. Return
 * whether the element is there. */
static bool find_attribute(const char *text, size_t size, const char *tag, const char *name,
                           char value[32]) {
  mesh_element element;
  const bool found = supine_io_element_find(text, text + size, tag, &element);
  if (!found || !supine_io_element_attribute(&element, name, value, 32)) {
    value[0] = '\0';
  }
  return found;
}

/* Find the unit of length of an X3D file, in metres. */
static void find_length(mesh_file *file) {
  const char *text = (const char *)file->bytes;
  const char *end = text + file->size;
  mesh_element element;
  while (supine_io_element_find(text, end, "unit", &element)) {
    char category[32] = "";
    char factor[32] = "";
    char *rest = NULL;
    (void)supine_io_element_attribute(&element, "category", category, sizeof category);
    (void)supine_io_element_attribute(&element, "conversionFactor", factor, sizeof factor);
    const double metres = supine_number_parse(factor, &rest);
    if (supine_ascii_same(category, "length") && rest != factor && metres > 0.0) {
      file->millimetres = 1000.0 * metres;
    }
    text = element.body;
  }
}

supine_status supine_io_find_unit(mesh_file *file, supine_error *error) {
  const char *text = (const char *)file->bytes;
  char unit[32];
  if (supine_text_ends_in(file->path, ".dae")) { /* assimp converts to metres, if it is not 1 */
    char *end = NULL;
    (void)find_attribute(text, file->size, "unit", "meter", unit);
    const double metres = supine_number_parse(unit, &end);
    file->millimetres = end != unit && metres > 0.0 && metres != 1.0 ? 1000.0 : 0.0;
  } else if (supine_text_ends_in(file->path, ".x3d")) {
    find_length(file);
  } else if (supine_text_ends_in(file->path, ".amf")) {
    (void)find_attribute(text, file->size, "amf", "unit", unit);
    SUPINE_TRY(take_name(file, unit, error));
  } else if (supine_text_ends_in(file->path, ".3mf")) {
    char head[8192];
    const size_t size = unpack_model(file, head, sizeof head - 1);
    head[size] = '\0';
    const bool known = find_attribute(head, size, "model", "unit", unit);
    SUPINE_REFUSE_IF(!known, error, SUPINE_ERROR_FORMAT,
                     "%s: it has no readable model, which states its unit; save the mesh as PLY",
                     file->path);
    SUPINE_TRY(take_name(file, unit, error));
  }
  return SUPINE_OK;
}
