/* SPDX-License-Identifier: MIT */
/* MetaImage with its voxels in the same file (.mha), as ITK, elastix and plastimatch write it:
 * lines "Key = value", the last of which is ElementDataFile, then the voxels. Its axes are LPS. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <zlib.h>

#include "sh/base/output.h"
#include "sh/base/vec3.h"

#include "mesh/image/formats.h"

enum { HEADER_MAX = 1 << 16 };

/* MetaIO's MET_LONG has 4 bytes on every machine. */
static const struct {
  const char *name;
  supine_image_voxel voxel;
  bool wide; /* 64-bit integers, read as F64 */
} types[] = {{"MET_CHAR", SUPINE_VOXEL_I8, false},      {"MET_UCHAR", SUPINE_VOXEL_U8, false},
             {"MET_SHORT", SUPINE_VOXEL_I16, false},    {"MET_USHORT", SUPINE_VOXEL_U16, false},
             {"MET_INT", SUPINE_VOXEL_I32, false},      {"MET_UINT", SUPINE_VOXEL_U32, false},
             {"MET_FLOAT", SUPINE_VOXEL_F32, false},    {"MET_DOUBLE", SUPINE_VOXEL_F64, false},
             {"MET_LONG", SUPINE_VOXEL_I32, false},     {"MET_ULONG", SUPINE_VOXEL_U32, false},
             {"MET_LONG_LONG", SUPINE_VOXEL_F64, true}, {"MET_ULONG_LONG", SUPINE_VOXEL_F64, true}};

enum { TYPES = sizeof types / sizeof *types };

typedef struct header {
  double dimensions, size[4], spacing[4], offset[4], matrix[16], channels, packed_size;
  bool binary, compressed, big_endian, is_image, is_local, ended;
  const char *type;
  size_t length; /* bytes before the voxels */
} header;

static bool is_true(const char *value) {
  return strcasecmp(value, "true") == 0 || strcmp(value, "1") == 0;
}

/* Parse up to `most` numbers; return how many. */
static size_t numbers(const char *text, double *values, size_t most) {
  size_t count = 0;
  for (char *end; count < most; text = end) {
    values[count] = strtod(text, &end);
    if (end == text) {
      break;
    }
    ++count;
  }
  return count;
}

/* Parse one line, ended by NUL; false if a list is too short. */
static bool take_line(char *key, char *value, header *h) {
  const struct {
    const char *key;
    double *values;
    bool squared;
  } lists[] = {{"DimSize", h->size, false},   {"ElementSpacing", h->spacing, false},
               {"Offset", h->offset, false},  {"Position", h->offset, false},
               {"Origin", h->offset, false},  {"TransformMatrix", h->matrix, true},
               {"Rotation", h->matrix, true}, {"Orientation", h->matrix, true}};
  const size_t n = (size_t)h->dimensions;
  for (size_t i = 0; i < sizeof lists / sizeof *lists; ++i) {
    if (strcmp(key, lists[i].key) == 0) {
      const size_t wanted = lists[i].squared ? n * n : n;
      return numbers(value, lists[i].values, wanted) == wanted;
    }
  }
  h->is_image = strcmp(key, "ObjectType") == 0 ? strcasecmp(value, "Image") == 0 : h->is_image;
  h->binary = strcmp(key, "BinaryData") == 0 ? is_true(value) : h->binary;
  h->compressed = strcmp(key, "CompressedData") == 0 ? is_true(value) : h->compressed;
  if (strcmp(key, "BinaryDataByteOrderMSB") == 0 || strcmp(key, "ElementByteOrderMSB") == 0) {
    h->big_endian = is_true(value);
  }
  if (strcmp(key, "NDims") == 0) {
    return numbers(value, &h->dimensions, 1) == 1 && (h->dimensions == 3.0 || h->dimensions == 4.0);
  }
  if (strcmp(key, "ElementNumberOfChannels") == 0) {
    return numbers(value, &h->channels, 1) == 1;
  }
  if (strcmp(key, "CompressedDataSize") == 0) {
    return numbers(value, &h->packed_size, 1) == 1;
  }
  h->type = strcmp(key, "ElementType") == 0 ? value : h->type;
  if (strcmp(key, "ElementDataFile") == 0) {
    h->ended = true;
    h->is_local = strcasecmp(value, "LOCAL") == 0;
  }
  return true;
}

/* Parse the lines of `text`, which is modified; return NULL or the error. */
static const char *read_header(char *text, header *h) {
  *h = (header){.spacing = {1.0, 1.0, 1.0, 1.0}, .channels = 1.0, .binary = true, .is_image = true};
  for (char *line = text; !h->ended;) {
    char *end = strchr(line, '\n');
    if (end == NULL) {
      return "no line ElementDataFile ends its header";
    }
    *end = '\0';
    char *value = strchr(line, '=');
    char *key = line + strspn(line, " \t");
    if (value == NULL) {
      return "a line of its header has no '='";
    }
    key[strcspn(key, " \t=")] = '\0';
    ++value;
    value += strspn(value, " \t");
    for (size_t l = strlen(value); l > 0 && strchr(" \t\r", value[l - 1]) != NULL; --l) {
      value[l - 1] = '\0';
    }
    if (!take_line(key, value, h)) {
      return "its header has too few numbers, or not three axes";
    }
    line = end + 1;
    h->length = (size_t)(line - text);
  }
  return !h->is_image          ? "it is not an image"
         : !h->is_local        ? "the voxels are in another file; save them in one (.mha)"
         : !h->binary          ? "voxels as text are not read"
         : h->dimensions < 3.0 ? "its header does not say NDims = 3"
         : h->dimensions == 4.0 && h->size[3] != 1.0 ? "several volumes; give one"
         : h->channels != 1.0                        ? "several numbers per voxel; give one"
                                                     : NULL;
}

/* Find size, frame and type; return NULL or the error. */
static const char *describe(const header *h, size_t file_size, supine_image *image, bool *wide) {
  size_t type = 0;
  while (type < TYPES && (h->type == NULL || strcmp(h->type, types[type].name) != 0)) {
    ++type;
  }
  if (type == TYPES) {
    return "its ElementType is not read";
  }
  const size_t n = (size_t)h->dimensions;
  bool framed = false;
  image->voxel = types[type].voxel;
  *wide = types[type].wide;
  image->axes = SUPINE_AXES_LPS;
  image->frame_source = "TransformMatrix";
  for (size_t a = 0; a < 3; ++a) {
    if (!(h->size[a] >= 1.0 && h->size[a] <= 1e6) || h->size[a] != (double)(size_t)h->size[a]) {
      return "its DimSize is invalid";
    }
    image->size[a] = (size_t)h->size[a];
    image->origin[a] = h->offset[a];
    for (size_t k = 0; k < 3; ++k) {
      image->step[a][k] = h->spacing[a] * h->matrix[a * n + k];
      framed = framed || h->matrix[a * n + k] != 0.0;
    }
  }
  for (size_t a = 0; !framed && a < 3; ++a) { /* without a matrix the axes are those of LPS */
    image->step[a][a] = h->spacing[a];
  }
  return supine_image_bytes(image, file_size) == 0 ? "its voxels are more than the file can hold"
                                                   : NULL;
}

static void swap_bytes(unsigned char *bytes, size_t count, size_t size) {
  for (size_t i = 0; i < count; ++i) {
    for (size_t b = 0; b < size / 2; ++b) {
      const unsigned char other = bytes[i * size + b];
      bytes[i * size + b] = bytes[i * size + size - 1 - b];
      bytes[i * size + size - 1 - b] = other;
    }
  }
}

/* Unpack the voxels from the rest of the file; false if they are incomplete. */
static bool unpack(const header *h, const unsigned char *packed, size_t packed_size,
                   unsigned char *values, size_t bytes) {
  if (!h->compressed) {
    if (packed_size < bytes) {
      return false;
    }
    memcpy(values, packed, bytes);
    return true;
  }
  uLongf made = bytes;
  return uncompress(values, &made, packed, packed_size) == Z_OK && made == bytes;
}

supine_status supine_image_read_mha(const char *path, size_t file_size, supine_image *image,
                                    supine_error *error) {
  FILE *file = fopen(path, "rb");
  unsigned char *bytes = malloc(file_size + 1);
  char *text = malloc(HEADER_MAX + 1);
  header h;
  bool wide = false;
  const char *wrong = NULL;
  supine_status status = SUPINE_ERROR_FORMAT;
  if (file == NULL || bytes == NULL || text == NULL) {
    status = supine_error_set(error, file == NULL ? SUPINE_ERROR_READ : SUPINE_ERROR_MEMORY,
                              "%s: cannot read", path);
    goto cleanup;
  }
  const size_t size = fread(bytes, 1, file_size, file);
  const size_t head = size < HEADER_MAX ? size : HEADER_MAX;
  memcpy(text, bytes, head);
  text[head] = '\0';
  wrong = read_header(text, &h);
  wrong = wrong == NULL ? describe(&h, file_size, image, &wide) : wrong;
  if (wrong == NULL) {
    const size_t count = image->size[0] * image->size[1] * image->size[2];
    const size_t each = supine_image_voxel_size(image->voxel);
    image->values = malloc(count * each);
    if (image->values == NULL) {
      status = supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
      goto cleanup;
    }
    if (unpack(&h, bytes + h.length, size - h.length, image->values, count * each)) {
      if (h.big_endian) {
        swap_bytes(image->values, count, each);
      }
      if (wide) {
        supine_image_widen(image->values, count, h.type[4] != 'U');
      }
      status = SUPINE_OK;
    } else {
      wrong = "truncated or damaged";
    }
  }
  if (wrong != NULL) {
    (void)supine_error_set(error, status, "%s: %s", path, wrong);
  }
cleanup:
  free(bytes);
  free(text);
  if (file != NULL) {
    (void)fclose(file);
  }
  return status;
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
  for (int a = 0; a < 3; ++a) {
    spacing[a] = supine_length(image->step[a]);
    for (int k = 0; k < 3; ++k) {
      (void)fprintf(file, " %.17g", image->step[a][k] / spacing[a]);
    }
  }
  (void)fprintf(file,
                "\nOffset = %.17g %.17g %.17g\nCenterOfRotation = 0 0 0\n"
                "AnatomicalOrientation = RAI\nElementSpacing = %.17g %.17g %.17g\n"
                "DimSize = %zu %zu %zu\n",
                image->origin[0], image->origin[1], image->origin[2], spacing[0], spacing[1],
                spacing[2], image->size[0], image->size[1], image->size[2]);
  if (image->channels > 1) {
    (void)fprintf(file, "ElementNumberOfChannels = %zu\n", image->channels);
  }
  (void)fprintf(file, "ElementType = %s\nElementDataFile = LOCAL\n", type);
}

supine_status supine_image_write_mha(const char *path, const supine_image *image, const char *note,
                                     supine_error *error) {
  enum { LEVEL = 3 };
  supine_output output = {0};
  const size_t bytes = image->size[0] * image->size[1] * image->size[2] * image->channels *
                       supine_image_voxel_size(image->voxel);
  uLongf size = compressBound(bytes);
  unsigned char *packed = malloc(size);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (packed == NULL || compress2(packed, &size, image->values, bytes, LEVEL) != Z_OK) {
    (void)supine_error_set(error, status, "%s: out of memory", path);
    goto cleanup;
  }
  status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK) {
    write_header(image, note, size, output.file);
    (void)fwrite(packed, 1, size, output.file);
    status = supine_output_commit(&output, error);
  }
cleanup:
  free(packed);
  return status;
}
