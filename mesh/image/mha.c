/* SPDX-License-Identifier: MIT */
/* Read and write MetaImage files that hold their voxels (.mha), as ITK, elastix and plastimatch do:
 * lines "Key = value", the last of which is ElementDataFile, then the voxels. Axes are LPS. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/number.h"
#include "base/quantity.h"
#include "base/vec3.h"

#include "mesh/image/image_formats.h"

enum { HEADER_MAX = 1 << 16 };

/* MetaIO's types of voxels. Its MET_LONG has 4 bytes on every machine. */
static const struct {
  const char *name;
  supine_image_voxel voxel;
  bool wide; /* whether voxels are 64-bit integers, which are read as F64 */
} types[] = {{"MET_CHAR", SUPINE_VOXEL_I8, false},      {"MET_UCHAR", SUPINE_VOXEL_U8, false},
             {"MET_SHORT", SUPINE_VOXEL_I16, false},    {"MET_USHORT", SUPINE_VOXEL_U16, false},
             {"MET_INT", SUPINE_VOXEL_I32, false},      {"MET_UINT", SUPINE_VOXEL_U32, false},
             {"MET_FLOAT", SUPINE_VOXEL_F32, false},    {"MET_DOUBLE", SUPINE_VOXEL_F64, false},
             {"MET_LONG", SUPINE_VOXEL_I32, false},     {"MET_ULONG", SUPINE_VOXEL_U32, false},
             {"MET_LONG_LONG", SUPINE_VOXEL_F64, true}, {"MET_ULONG_LONG", SUPINE_VOXEL_F64, true}};

enum { TYPES = sizeof types / sizeof *types };

/* The "Key = value" lines of a header, as pointers into its text. */
typedef struct header {
  size_t count;
  const char **key, **value;
  size_t length; /* bytes before the voxels */
  bool contrary; /* whether two lines that were asked for state different values */
} header;

/* Return the value with one of three keys, or "" if there is none. Unused keys are "". */
static const char *value_of(header *h, const char *key, const char *second, const char *third) {
  const char *value = "";
  for (size_t i = 0; i < h->count; ++i) {
    if (strcmp(h->key[i], key) == 0 || strcmp(h->key[i], second) == 0 ||
        strcmp(h->key[i], third) == 0) {
      h->contrary = h->contrary || (*value != '\0' && strcmp(value, h->value[i]) != 0);
      value = h->value[i];
    }
  }
  return value;
}

static bool is_true(const char *value) {
  return supine_ascii_same(value, "true") || strcmp(value, "1") == 0;
}

/* Parse `count` numbers; return false if `text` is malformed. An empty `text` changes nothing. */
static bool numbers(const char *text, double *values, size_t count) {
  bool good = true;
  for (size_t i = 0; i < count && good && *text != '\0'; ++i) {
    char *end;
    values[i] = supine_number_parse(text, &end);
    good = end != text && (*end != '\0' || i + 1 == count);
    text = end;
  }
  return good;
}

/* Find the distances between voxels, in the unit of the file. Like MetaIO, take the sizes of voxels
 * for them if they are not stated. Return NULL, or a message if neither is stated. */
static const char *find_spacing(header *h, size_t count, double *spacing) {
  const char *text = value_of(h, "ElementSpacing", "", "");
  text = *text != '\0' ? text : value_of(h, "ElementSize", "", "");
  if (*text == '\0') {
    for (size_t i = 0; i < h->count; ++i) {
      if (supine_ascii_same(h->key[i], "Spacing") ||
          supine_ascii_same(h->key[i], "ElementSpacing")) {
        return "its header gives the voxel spacing a name for which other programs take 1 mm: "
               "name it ElementSpacing";
      }
    }
    return "its header states no voxel spacing: add the line ElementSpacing, in mm";
  }
  if (!numbers(text, spacing, count)) {
    return "a line of its header has too few numbers; save the image again";
  }
  for (size_t a = 0; a < 3; ++a) {
    if (!(spacing[a] > 0.0)) {
      return "its ElementSpacing is not above 0; save the image again";
    }
  }
  return NULL;
}

/* Split `text`, which is modified, into keys and values. Return NULL, or a message on failure.
 * @param h  `key` and `value` have room for each line of the text */
static const char *read_header(char *text, header *h) {
  for (char *line = text; h->count == 0 || strcmp(h->key[h->count - 1], "ElementDataFile") != 0;) {
    char *end = strchr(line, '\n');
    if (end == NULL) {
      return "its header does not end with ElementDataFile; write the image again";
    }
    *end = '\0';
    char *value = strchr(line, '=');
    char *key = line + strspn(line, " \t");
    if (value == NULL) {
      return "a line of its header has no '='; write the image again";
    }
    key[strcspn(key, " \t=")] = '\0';
    ++value;
    value += strspn(value, " \t");
    for (size_t l = strlen(value); l > 0 && strchr(" \t\r", value[l - 1]) != NULL; --l) {
      value[l - 1] = '\0';
    }
    h->key[h->count] = key;
    h->value[h->count++] = value;
    line = end + 1;
    h->length = (size_t)(line - text);
  }
  return NULL;
}

/* Check that the voxels are binary numbers in this file; return NULL, or a message on failure. */
static const char *check(header *h) {
  const char *object = value_of(h, "ObjectType", "", "");
  const char *binary = value_of(h, "BinaryData", "", "");
  if (*object != '\0' && !supine_ascii_same(object, "Image")) {
    return "its ObjectType is not Image; give an image";
  }
  if (!supine_ascii_same(value_of(h, "ElementDataFile", "", ""), "LOCAL")) {
    return "the voxels are in another file; save header and voxels in one .mha";
  }
  if (*binary != '\0' && !is_true(binary)) {
    return "its voxels are text; save them as binary numbers";
  }
  return NULL;
}

/* Set the steps from the rows of a matrix [n, n]. Without a matrix, which is then 0, the axes of
 * the image are x, y and z. */
static void set_steps(supine_image *image, const double *spacing, const double *matrix, size_t n) {
  bool framed = false;
  for (size_t a = 0; a < 3; ++a) {
    for (size_t k = 0; k < 3; ++k) {
      image->step[a][k] = spacing[a] * matrix[a * n + k];
      framed = framed || matrix[a * n + k] != 0.0;
    }
  }
  if (!framed) {
    for (size_t a = 0; a < 3; ++a) {
      image->step[a][a] = spacing[a];
    }
  }
}

/* Find the image's size, position, axes and type; return NULL, or a message on failure. */
static const char *describe(header *h, supine_image *image, size_t *type_index) {
  const char *name = value_of(h, "ElementType", "", "");
  const char *unit = value_of(h, "DistanceUnits", "", "");
  double millimetres = 1.0; /* of the unit */
  double dimensions = 0.0;
  double channels = 1.0;
  double size[4] = {0.0};
  double spacing[4] = {1.0, 1.0, 1.0, 1.0};
  double offset[4] = {0.0};
  double matrix[16] = {0.0};
  if (!numbers(value_of(h, "NDims", "", ""), &dimensions, 1) ||
      (dimensions != 3.0 && dimensions != 4.0)) {
    return "its header does not say NDims = 3; give an image of three axes";
  }
  const size_t n = (size_t)dimensions;
  if (!numbers(value_of(h, "DimSize", "", ""), size, n) ||
      !numbers(value_of(h, "Offset", "Position", "Origin"), offset, n) ||
      !numbers(value_of(h, "TransformMatrix", "Rotation", "Orientation"), matrix, n * n) ||
      !numbers(value_of(h, "ElementNumberOfChannels", "", ""), &channels, 1)) {
    return "a line of its header has too few numbers; save the image again";
  }
  const char *unspaced = find_spacing(h, n, spacing);
  if (unspaced != NULL) {
    return unspaced;
  }
  if (*unit != '\0' && strcmp(unit, "?") != 0 &&
      !supine_quantity_find_unit(SUPINE_QUANTITY_LENGTH, unit, &millimetres)) {
    return "its DistanceUnits are unknown; save the image in mm";
  }
  if (channels != 1.0 || (n == 4 && size[3] != 1.0)) {
    return channels != 1.0 ? "it has several numbers per voxel; save one channel alone"
                           : "it has several volumes; save one volume alone";
  }
  size_t type = 0;
  while (type < TYPES && strcmp(name, types[type].name) != 0) {
    ++type;
  }
  if (type == TYPES) {
    return "its ElementType is not supported; save it as MET_SHORT";
  }
  *type_index = type;
  image->voxel = types[type].voxel;
  image->axes = SUPINE_AXES_LPS;
  image->frame_source = "TransformMatrix";
  for (size_t a = 0; a < 3; ++a) {
    if (!(size[a] >= 1.0 && size[a] <= 1e6) || size[a] != (double)(size_t)size[a]) {
      return "its DimSize is invalid; save the image again";
    }
    image->size[a] = (size_t)size[a];
    image->origin[a] = millimetres * offset[a];
    spacing[a] *= millimetres;
  }
  set_steps(image, spacing, matrix, n);
  return NULL;
}

supine_status supine_image_describe_mha(const char *path, FILE *file, supine_image *image,
                                        image_storage *storage, supine_error *error) {
  SUPINE_ARENA arena = {0};
  char *text = supine_arena_take(&arena, HEADER_MAX + 1, 1);
  SUPINE_TRY(supine_arena_check(&arena, error, "the header of %s", path));
  size_t type = 0;
  size_t lines = 1;
  text[fread(text, 1, HEADER_MAX, file)] = '\0';
  for (const char *at = strchr(text, '\n'); at != NULL; at = strchr(at + 1, '\n')) {
    ++lines;
  }
  header h = {.key = supine_arena_take(&arena, lines, sizeof *h.key),
              .value = supine_arena_take(&arena, lines, sizeof *h.value)};
  SUPINE_TRY(supine_arena_check(&arena, error, "the header of %s", path));
  const char *wrong = read_header(text, &h);
  wrong = wrong == NULL ? check(&h) : wrong;
  wrong = wrong == NULL ? describe(&h, image, &type) : wrong;
  int integer = 0; /* 1: int64, -1: uint64 */
  if (types[type].wide) {
    integer = types[type].name[4] == 'U' ? -1 : 1;
  }
  *storage = (image_storage){
      .offset = (int64_t)h.length,
      .packed = is_true(value_of(&h, "CompressedData", "", "")),
      .big_endian = is_true(value_of(&h, "BinaryDataByteOrderMSB", "ElementByteOrderMSB", "")),
      .integer = integer};
  if (wrong == NULL && h.contrary) {
    wrong = "its header states one thing twice, with different values; save the image again";
  }
  SUPINE_REFUSE_IF(wrong != NULL, error, SUPINE_ERROR_FORMAT, "%s: %s", path, wrong);
  return SUPINE_OK;
}

/* Name the directions from which the axes come, as MetaIO does: RAI if they are x, y and z. Each
 * axis is named for its largest component, the largest first, so that no letter pair occurs twice.
 */
static void name_orientation(const supine_image *image, char name[4]) {
  static const char from[3][2] = {{'R', 'L'}, {'A', 'P'}, {'I', 'S'}};
  bool named[3] = {false, false, false};
  bool used[3] = {false, false, false};
  for (int round = 0; round < 3; ++round) {
    size_t axis = 0;
    size_t component = 0;
    double largest = -1.0;
    for (size_t i = 0; i < 9; ++i) {
      const size_t a = i / 3;
      const size_t k = i % 3;
      const double share = fabs(image->step[a][k]) / supine_length(image->step[a]);
      if (!named[a] && !used[k] && share > largest) {
        largest = share;
        axis = a;
        component = k;
      }
    }
    name[axis] = from[component][image->step[axis][component] < 0.0];
    named[axis] = used[component] = true;
  }
  name[3] = '\0';
}

static void write_header(const supine_image *image, const char *note, size_t packed, FILE *file) {
  const char *type = NULL;
  for (size_t i = 0; i < TYPES && type == NULL; ++i) {
    type = types[i].voxel == image->voxel ? types[i].name : NULL;
  }
  (void)fputs("ObjectType = Image\nNDims = 3\n", file);
  if (note != NULL) {
    (void)fprintf(file, "Comment = %s\n", note);
  }
  (void)fprintf(file,
                "BinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = True\n"
                "CompressedDataSize = %zu\nTransformMatrix =",
                packed);
  double spacing[3];
  char orientation[4];
  name_orientation(image, orientation);
  for (int a = 0; a < 3; ++a) {
    spacing[a] = supine_length(image->step[a]);
    for (int k = 0; k < 3; ++k) {
      (void)supine_print(file, " %.17g", image->step[a][k] / spacing[a]);
    }
  }
  (void)supine_print(file,
                     "\nOffset = %.17g %.17g %.17g\nCenterOfRotation = 0 0 0\n"
                     "AnatomicalOrientation = %s\nElementSpacing = %.17g %.17g %.17g\n"
                     "DimSize = %zu %zu %zu\n",
                     image->origin[0], image->origin[1], image->origin[2], orientation, spacing[0],
                     spacing[1], spacing[2], image->size[0], image->size[1], image->size[2]);
  if (image->channels > 1) {
    (void)fprintf(file, "ElementNumberOfChannels = %zu\n", image->channels);
  }
  (void)fprintf(file, "ElementType = %s\nElementDataFile = LOCAL\n", type);
}

supine_status supine_image_write_mha(const char *path, const supine_image *image, const char *note,
                                     FILE *file, supine_error *error) {
  char *packed = NULL; /* compressed in memory first, as the header states the compressed size */
  size_t size = 0;
  FILE *memory = open_memstream(&packed, &size);
  supine_status status = memory == NULL
                             ? SUPINE_ERROR_MEMORY
                             : supine_image_pack(IMAGE_ZLIB, NULL, 0, image, image->values, memory);
  (void)path;
  (void)error;
  if (memory != NULL && fclose(memory) != 0) {
    status = SUPINE_ERROR_MEMORY;
  }
  if (status == SUPINE_OK) {
    write_header(image, note, size, file);
    (void)fwrite(packed, 1, size, file);
  }
  free(packed);
  return status;
}
