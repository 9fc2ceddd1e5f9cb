/* SPDX-License-Identifier: MIT */
/* Read and write NRRD files that hold their voxels: a magic line, lines "field: value" and
 * "key:=value", an empty line, then the voxels (teem.sourceforge.net/nrrd/format.html). */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/number.h"
#include "base/quantity.h"
#include "mesh/image/image_formats.h"

/* The names of each type of voxels. The first is the one that is written. */
static const struct {
  supine_image_voxel voxel;
  int integer; /* as in image_storage */
  const char *names[7];
} types[] = {
    {SUPINE_VOXEL_I8, 0, {"int8", "int8_t", "signed char"}},
    {SUPINE_VOXEL_U8, 0, {"uint8", "uint8_t", "unsigned char", "uchar"}},
    {SUPINE_VOXEL_I16,
     0,
     {"int16", "int16_t", "short", "short int", "signed short", "signed short int"}},
    {SUPINE_VOXEL_U16, 0, {"uint16", "uint16_t", "ushort", "unsigned short", "unsigned short int"}},
    {SUPINE_VOXEL_I32, 0, {"int32", "int32_t", "int", "signed int"}},
    {SUPINE_VOXEL_U32, 0, {"uint32", "uint32_t", "uint", "unsigned int"}},
    {SUPINE_VOXEL_F32, 0, {"float"}},
    {SUPINE_VOXEL_F64, 0, {"double"}},
    {SUPINE_VOXEL_F64,
     1,
     {"int64", "int64_t", "longlong", "long long", "long long int", "signed long long",
      "signed long long int"}},
    {SUPINE_VOXEL_F64,
     -1,
     {"uint64", "uint64_t", "ulonglong", "unsigned long long", "unsigned long long int"}}};

enum { TYPES = sizeof types / sizeof *types, NAMES = sizeof types[0].names / sizeof(char *) };

/* Fields whose values are used. */
typedef enum field {
  FIELD_TYPE,
  FIELD_DIMENSION,
  FIELD_SPACE,
  FIELD_SIZES,
  FIELD_DIRECTIONS,
  FIELD_ORIGIN,
  FIELD_UNITS,
  FIELD_ENCODING,
  FIELD_ENDIAN,
  FIELD_LINE_SKIP,
  FIELD_BYTE_SKIP,
  FIELD_DATA_FILE,
  FIELD_UNUSED, /* any field that changes neither the voxels nor their positions */
  FIELDS
} field;

static const struct {
  const char *name;
  field field;
} fields[] = {{"type", FIELD_TYPE},
              {"dimension", FIELD_DIMENSION},
              {"space", FIELD_SPACE},
              {"sizes", FIELD_SIZES},
              {"space directions", FIELD_DIRECTIONS},
              {"space origin", FIELD_ORIGIN},
              {"encoding", FIELD_ENCODING},
              {"endian", FIELD_ENDIAN},
              {"line skip", FIELD_LINE_SKIP},
              {"lineskip", FIELD_LINE_SKIP},
              {"byte skip", FIELD_BYTE_SKIP},
              {"byteskip", FIELD_BYTE_SKIP},
              {"data file", FIELD_DATA_FILE},
              {"datafile", FIELD_DATA_FILE},
              {"space dimension", FIELD_UNUSED},
              {"space units", FIELD_UNITS},
              {"measurement frame", FIELD_UNUSED},
              {"content", FIELD_UNUSED},
              {"number", FIELD_UNUSED},
              {"block size", FIELD_UNUSED},
              {"blocksize", FIELD_UNUSED},
              {"spacings", FIELD_UNUSED},
              {"thicknesses", FIELD_UNUSED},
              {"axis mins", FIELD_UNUSED},
              {"axismins", FIELD_UNUSED},
              {"axis maxs", FIELD_UNUSED},
              {"axismaxs", FIELD_UNUSED},
              {"centers", FIELD_UNUSED},
              {"centerings", FIELD_UNUSED},
              {"kinds", FIELD_UNUSED},
              {"labels", FIELD_UNUSED},
              {"units", FIELD_UNUSED},
              {"min", FIELD_UNUSED},
              {"max", FIELD_UNUSED},
              {"old min", FIELD_UNUSED},
              {"oldmin", FIELD_UNUSED},
              {"old max", FIELD_UNUSED},
              {"oldmax", FIELD_UNUSED},
              {"sample units", FIELD_UNUSED},
              {"sampleunits", FIELD_UNUSED}};

/* Values of the fields, `absent` where the header lacks a field. */
typedef struct header {
  const char *value[FIELDS];
} header;

static const char absent[] = "";

/* Remove blanks from both ends of a text. */
static char *trim(char *text) {
  text += strspn(text, " \t");
  size_t length = strlen(text);
  while (length > 0 && (text[length - 1] == ' ' || text[length - 1] == '\t')) {
    --length;
  }
  text[length] = '\0';
  return text;
}

/* Find the colon that ends the name of a field: one that a blank or the line's end follows. */
static char *find_colon(char *line) {
  char *colon = strchr(line, ':');
  while (colon != NULL && strchr(" \t", colon[1]) == NULL) { /* also finds the NUL after ':' */
    colon = strchr(colon + 1, ':');
  }
  return colon;
}

/* Find a field by its name; FIELDS if there is none. */
static field find_field(const char *name) {
  size_t f = 0;
  while (f < sizeof fields / sizeof *fields && !supine_ascii_same(name, fields[f].name)) {
    ++f;
  }
  return f < sizeof fields / sizeof *fields ? fields[f].field : FIELDS;
}

/* Store the value of a line "field: value", which may not set a field again. Skip "key:=value",
 * whose key and value may hold anything. Return whether the line is one of both. */
static bool take_line(char *line, header *h, supine_arena *arena) {
  const bool keyed = strstr(line, ":=") != NULL;
  char *colon = find_colon(line);
  if (colon == NULL) {
    return keyed;
  }
  *colon = '\0';
  const char *value = trim(colon + 1);
  const field found = find_field(trim(line));
  if (found == FIELDS) {
    return keyed;
  }
  if (found == FIELD_UNUSED) {
    return true;
  }
  if (h->value[found] != absent) {
    return false;
  }
  const size_t size = strlen(value) + 1;
  char *copy = supine_arena_take(arena, size, 1);
  if (copy != NULL) {
    memcpy(copy, value, size);
    h->value[found] = copy;
  }
  return true;
}

static void free_line(char **line) {
  free(*line);
}

/* Read the lines up to the empty one, which may hold blanks, after which the voxels begin. */
static supine_status read_header(const char *path, FILE *file, header *h, supine_arena *arena,
                                 supine_error *error) {
  char magic[16] = "";
  SUPINE_FREED_BY(free_line) char *line = NULL;
  size_t room = 0;
  for (int i = 0; i < FIELDS; ++i) {
    h->value[i] = absent;
  }
  const bool begun = fgets(magic, sizeof magic, file) != NULL;
  magic[strcspn(magic, "\r\n")] = '\0';
  SUPINE_REFUSE_IF(!begun || strlen(magic) != 8 || strncmp(magic, "NRRD000", 7) != 0 ||
                       magic[7] < '1' || magic[7] > '6',
                   error, SUPINE_ERROR_FORMAT,
                   "%s: its first line is not NRRD0001 to NRRD0006; give an NRRD file", path);
  for (size_t number = 2;; ++number) {
    const ssize_t length = getline(&line, &room, file);
    SUPINE_REFUSE_IF(length < 0 && feof(file) == 0, error, SUPINE_ERROR_READ, "%s: cannot read: %s",
                     path, strerror(errno));
    SUPINE_REFUSE_IF(length < 0, error, SUPINE_ERROR_FORMAT,
                     "%s: no empty line ends its header; write the image again", path);
    const bool text = strlen(line) == (size_t)length;
    line[strcspn(line, "\r\n")] = '\0';
    char *begin = line + strspn(line, " \t");
    if (text && *begin == '\0') {
      return supine_arena_check(arena, error, "the header of %s", path);
    }
    const bool known = text && (*begin == '#' || take_line(line, h, arena));
    SUPINE_REFUSE_IF(
        !known, error, SUPINE_ERROR_FORMAT,
        "%s: line %zu is not a field of an NRRD header, or sets one again; write the image again",
        path, number);
    SUPINE_REFUSE_IF(h->value[FIELD_DATA_FILE] != absent, error, SUPINE_ERROR_FORMAT,
                     "%s: its voxels are in another file; save all in one file", path);
  }
}

/* Parse `count` vectors such as "(1,0,0)"; return false if there are fewer or more. */
static bool read_vectors(const char *text, size_t count, double vectors[][3]) {
  static const char before[] = "(,,";
  for (size_t i = 0; i < count; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      text += strspn(text, " \t");
      if (*text != before[k]) {
        return false;
      }
      ++text;
      if (!supine_image_number(&text, &vectors[i][k])) {
        return false;
      }
    }
    text += strspn(text, " \t");
    if (*text != ')') {
      return false;
    }
    ++text;
    text += strspn(text, " \t");
  }
  return *text == '\0';
}

/* Parse `count` whole numbers from 1 to INT32_MAX; return false if there are fewer or more. */
static bool read_counts(const char *text, size_t count, size_t *counts) {
  for (size_t i = 0; i < count; ++i) {
    double value = 0.0;
    if (!supine_image_number(&text, &value) || !(value >= 1.0 && value <= INT32_MAX) ||
        value != floor(value)) {
      return false;
    }
    counts[i] = (size_t)value;
  }
  return *text == '\0';
}

/* Return whether the value is one of `count` words, ignoring case. */
static bool is_one_of(const char *value, const char *const *words, size_t count) {
  bool is = false;
  for (size_t i = 0; i < count; ++i) {
    is = is || (words[i] != NULL && supine_ascii_same(value, words[i]));
  }
  return is;
}

/* Read the vectors of the axes, and the sizes. An axis without a direction, "none", is that of the
 * layers of a segmentation: it must have one, and is removed. Return NULL, or a message on failure.
 */
static const char *read_axes(const header *h, size_t dimension, supine_image *image) {
  enum { MOST = 4 };
  const char *directions = h->value[FIELD_DIRECTIONS];
  const char *none = strstr(directions, "none");
  char text[512];
  size_t size[MOST] = {0};
  if (!read_counts(h->value[FIELD_SIZES], dimension, size)) {
    return "its sizes are not whole numbers, one for each axis; write the image again";
  }
  size_t layer = dimension; /* index of the axis without a direction */
  (void)snprintf(text, sizeof text, "%s", directions);
  if (none != NULL && dimension == MOST && strlen(directions) < sizeof text) {
    layer = 0;
    for (const char *at = directions; at < none; ++at) {
      layer += *at == ')' ? 1 : 0;
    }
    memset(text + (none - directions), ' ', 4);
  }
  if (dimension == MOST && (layer == dimension || size[layer] != 1)) {
    return "its dimension is 4, and it does not have one layer; give an image with one number per "
           "voxel and three axes, or export one layer of the segmentation";
  }
  for (size_t a = 0, k = 0; a < dimension; ++a) {
    if (a != layer) {
      image->size[k++] = size[a];
    }
  }
  const bool placed =
      read_vectors(text + strspn(text, " \t"), 3, image->step) &&
      (h->value[FIELD_ORIGIN] == absent || read_vectors(h->value[FIELD_ORIGIN], 1, &image->origin));
  return placed ? NULL
                : "its space directions and space origin are not vectors of three numbers; write "
                  "the image again";
}

/* Find the unit of positions: the first in quotes, which all must have. An empty one is mm. */
static bool read_unit(const char *units, double *millimetres) {
  char first[16] = "";
  *millimetres = 1.0;
  for (const char *at = strchr(units, '"'); at != NULL; at = strchr(at, '"')) {
    char unit[16];
    const size_t length = strcspn(at + 1, "\"");
    (void)snprintf(unit, sizeof unit, "%.*s", (int)(length < 15 ? length : 15), at + 1);
    if (*first == '\0') {
      memcpy(first, unit, sizeof first);
    }
    if (strcmp(first, unit) != 0) {
      return false;
    }
    at += 1 + length;
    at += *at != '\0' ? 1 : 0;
  }
  return *first == '\0' || supine_quantity_find_unit(SUPINE_QUANTITY_LENGTH, first, millimetres);
}

/* Find sizes, position and axes. Without an origin, the first voxel is at 0, as in teem. */
static supine_status find_frame(const char *path, const header *h, supine_image *image,
                                supine_error *error) {
  static const char *const lps_names[] = {"left-posterior-superior", "LPS"};
  static const char *const ras_names[] = {"right-anterior-superior", "RAS"};
  size_t dimension = 0;
  double unit = 1.0;
  const char *space = h->value[FIELD_SPACE];
  const bool stated = read_counts(h->value[FIELD_DIMENSION], 1, &dimension);
  SUPINE_REFUSE_IF(!stated, error, SUPINE_ERROR_FORMAT,
                   "%s: its header states no dimension; write the image again", path);
  SUPINE_REFUSE_IF(dimension != 3 && dimension != 4, error, SUPINE_ERROR_FORMAT,
                   "%s: dimension %zu; give an image with one number per voxel and three axes",
                   path, dimension);
  SUPINE_REFUSE_IF(h->value[FIELD_DIRECTIONS] == absent, error, SUPINE_ERROR_FORMAT,
                   "%s: the header lacks space directions for its 3 axes; add them", path);
  const bool lps = is_one_of(space, lps_names, 2);
  const bool ras = is_one_of(space, ras_names, 2);
  SUPINE_REFUSE_IF(!lps && !ras, error, SUPINE_ERROR_FORMAT,
                   "%s: its space is neither left-posterior-superior nor right-anterior-superior; "
                   "convert the image to one of them",
                   path);
  const char *wrong = read_axes(h, dimension, image);
  SUPINE_REFUSE_IF(wrong != NULL, error, SUPINE_ERROR_FORMAT, "%s: %s", path, wrong);
  const bool measured = read_unit(h->value[FIELD_UNITS], &unit);
  SUPINE_REFUSE_IF(!measured, error, SUPINE_ERROR_FORMAT,
                   "%s: its space units are unknown or differ; write the image in mm", path);
  image->axes = lps ? SUPINE_AXES_LPS : SUPINE_AXES_RAS;
  image->frame_source = "space directions";
  for (int k = 0; k < 3; ++k) {
    const double turn = ras && k < 2 ? -unit : unit;
    image->origin[k] *= turn;
    for (int a = 0; a < 3; ++a) {
      image->step[a][k] *= turn;
    }
  }
  return SUPINE_OK;
}

/* Find how the voxels are stored. */
static supine_status find_storage(const char *path, const header *h, supine_image *image,
                                  image_storage *storage, supine_error *error) {
  static const char *const gzip[] = {"gzip", "gz"};
  static const char *const text[] = {"ascii", "text", "txt"};
  static const char *const hex[] = {"hex"};
  const char *encoding = h->value[FIELD_ENCODING];
  const char *endian = h->value[FIELD_ENDIAN];
  const char *lines = h->value[FIELD_LINE_SKIP];
  const char *bytes = h->value[FIELD_BYTE_SKIP];
  const bool skips =
      (*lines != '\0' && strcmp(lines, "0") != 0) || (*bytes != '\0' && strcmp(bytes, "0") != 0);
  storage->packed = is_one_of(encoding, gzip, 2);
  storage->text = is_one_of(encoding, text, 3);
  storage->hex = is_one_of(encoding, hex, 1);
  storage->big_endian = supine_ascii_same(endian, "big");
  const bool raw = supine_ascii_same(encoding, "raw");
  SUPINE_REFUSE_IF(
      (!raw && !storage->packed && !storage->text && !storage->hex) || skips, error,
      SUPINE_ERROR_FORMAT,
      "%s: its encoding is not raw, gzip, ascii or hex, or its header skips lines or bytes; "
      "save the image again as gzip",
      path);
  size_t type = 0;
  while (type < TYPES && !is_one_of(h->value[FIELD_TYPE], types[type].names, NAMES)) {
    ++type;
  }
  SUPINE_REFUSE_IF(type == TYPES, error, SUPINE_ERROR_FORMAT,
                   "%s: its type is not a number of 8 to 64 bits; convert the voxels to int16",
                   path);
  image->voxel = types[type].voxel;
  storage->integer = types[type].integer;
  const bool ordered = storage->big_endian || supine_ascii_same(endian, "little");
  SUPINE_REFUSE_IF(!ordered && !storage->text && supine_image_voxel_size(image->voxel) > 1, error,
                   SUPINE_ERROR_FORMAT,
                   "%s: its endian is neither little nor big; write the image again", path);
  return SUPINE_OK;
}

supine_status supine_image_describe_nrrd(const char *path, FILE *file, supine_image *image,
                                         image_storage *storage, supine_error *error) {
  SUPINE_ARENA arena = {0};
  header h;
  SUPINE_TRY(read_header(path, file, &h, &arena, error));
  SUPINE_TRY(find_frame(path, &h, image, error));
  SUPINE_TRY(find_storage(path, &h, image, storage, error));
  storage->offset = ftello(file);
  return SUPINE_OK;
}

supine_status supine_image_write_nrrd(const char *path, const supine_image *image, const char *note,
                                      FILE *file, supine_error *error) {
  const bool vector = image->channels > 1;
  (void)path;
  (void)error;
  (void)fprintf(file, "NRRD0004\n%s%s%stype: %s\ndimension: %d\nsizes:", note != NULL ? "# " : "",
                note != NULL ? note : "", note != NULL ? "\n" : "", types[image->voxel].names[0],
                vector ? 4 : 3);
  if (vector) {
    (void)fprintf(file, " %zu", image->channels);
  }
  (void)fprintf(file,
                " %zu %zu %zu\nspace: left-posterior-superior\nkinds:%s domain domain domain\n"
                "space directions:%s",
                image->size[0], image->size[1], image->size[2], vector ? " vector" : "",
                vector ? " none" : "");
  for (int a = 0; a < 3; ++a) {
    const double *s = image->step[a];
    (void)supine_print(file, " (%.17g,%.17g,%.17g)", s[0], s[1], s[2]);
  }
  (void)supine_print(file,
                     "\nspace origin: (%.17g,%.17g,%.17g)\nendian: little\nencoding: gzip\n\n",
                     image->origin[0], image->origin[1], image->origin[2]);
  return supine_image_pack(IMAGE_GZIP, NULL, 0, image, image->values, file);
}
