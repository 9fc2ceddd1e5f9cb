/* SPDX-License-Identifier: MIT */
/* Images: which format, what is checked of both, voxels as numbers. */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "sh/base/clones.h"
#include "sh/base/text.h"
#include "sh/base/vec3.h"

#include "mesh/image/formats.h"

static bool is_nifti(const char *path) {
  return supine_text_ends_in_any_case(path, ".nii") ||
         supine_text_ends_in_any_case(path, ".nii.gz");
}

bool supine_image_supports(const char *path) {
  return supine_text_ends_in_any_case(path, ".nrrd") || is_nifti(path);
}

bool supine_image_is_named(const char *path) {
  static const char *const others[] = {".mha", ".mhd", ".nhdr", ".mgz", ".dcm", ".hdr", ".img"};
  bool is = supine_image_supports(path);
  for (size_t i = 0; i < sizeof others / sizeof *others; ++i) {
    is = is || supine_text_ends_in_any_case(path, others[i]);
  }
  return is;
}

/* Finite, and three directions? A voxel's edges are no closer than a thousandth of a right angle.
 */
static bool is_frame(const supine_image *image) {
  double lengths = 1.0;
  for (int a = 0; a < 3; ++a) {
    const double *s = image->step[a];
    lengths *= supine_length(s);
    if (!isfinite(image->origin[a])) {
      return false;
    }
  }
  return isfinite(lengths) && lengths > 0.0 &&
         fabs(supine_triple(image->step[0], image->step[1], image->step[2])) > 1e-3 * lengths;
}

size_t supine_image_bytes(const supine_image *image, size_t file_size) {
  const double bytes = (double)image->size[0] * (double)image->size[1] * (double)image->size[2] *
                       (double)supine_image_voxel_size(image->voxel);
  return bytes <= (double)SUPINE_IMAGE_GZIP_RATIO * (double)file_size ? (size_t)bytes : 0;
}

supine_status supine_image_read(const char *path, supine_image *image, supine_error *error) {
  struct stat file = {0};
  supine_image read = {.channels = 1};
  if (!supine_image_supports(path)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: an image's name must end in .nrrd, .nii or .nii.gz; others are "
                            "to be converted, as by 3D Slicer or 'plastimatch convert'",
                            path);
  }
  if (stat(path, &file) != 0 || !S_ISREG(file.st_mode)) {
    return supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot read: %s", path,
                            strerror(errno == 0 ? EISDIR : errno)); /* NOLINT */
  }
  supine_status status = is_nifti(path)
                             ? supine_image_read_nifti(path, (size_t)file.st_size, &read, error)
                             : supine_image_read_nrrd(path, (size_t)file.st_size, &read, error);
  if (status == SUPINE_OK && !is_frame(&read)) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: the header's directions are no three axes", path);
  }
  if (status != SUPINE_OK) {
    supine_image_free(&read);
    return status;
  }
  *image = read;
  return SUPINE_OK;
}

void supine_image_free(supine_image *image) {
  free(image->values);
  *image = (supine_image){0};
}

supine_status supine_image_write(const char *path, const supine_image *image, const char *note,
                                 supine_error *error) {
  if (!supine_image_supports(path)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%s: an image's name must end in .nrrd, .nii or .nii.gz", path);
  }
  return is_nifti(path) ? supine_image_write_nifti(path, supine_text_ends_in_any_case(path, ".gz"),
                                                   image, note, error)
                        : supine_image_write_nrrd(path, image, note, error);
}

size_t supine_image_voxel_size(supine_image_voxel voxel) {
  static const size_t sizes[SUPINE_VOXEL_COUNT] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[voxel];
}

double supine_image_get(const supine_image *image, size_t index) {
  double value = 0.0;
  supine_image_gather(image, index, &(size_t){0}, 1, &value);
  return value;
}

#define GATHER(type)                                                                               \
  for (size_t i = 0; i < count; ++i) {                                                             \
    values[i] = (double)((const type *)image->values)[from + index[i]];                            \
  }                                                                                                \
  break

SUPINE_CLONES void supine_image_gather(const supine_image *image, size_t from, const size_t *index,
                                       size_t count, double *restrict values) {
  switch (image->voxel) {
  case SUPINE_VOXEL_I8:
    GATHER(int8_t);
  case SUPINE_VOXEL_U8:
    GATHER(uint8_t);
  case SUPINE_VOXEL_I16:
    GATHER(int16_t);
  case SUPINE_VOXEL_U16:
    GATHER(uint16_t);
  case SUPINE_VOXEL_I32:
    GATHER(int32_t);
  case SUPINE_VOXEL_U32:
    GATHER(uint32_t);
  case SUPINE_VOXEL_F32:
    GATHER(float);
  case SUPINE_VOXEL_F64:
  case SUPINE_VOXEL_COUNT:
    GATHER(double);
  }
}

static double clip(double value, double low, double high) {
  const double whole = rint(value);
  return whole > low ? (whole < high ? whole : high) : low; /* low where it is not a number */
}

#define PUT(type, number)                                                                          \
  for (size_t i = 0; i < count; ++i) {                                                             \
    ((type *)image->values)[begin + i] = (type)(number);                                           \
  }                                                                                                \
  break

SUPINE_CLONES void supine_image_put(supine_image *image, size_t begin, size_t count,
                                    const double *restrict values) {
  switch (image->voxel) {
  case SUPINE_VOXEL_I8:
    PUT(int8_t, clip(values[i], INT8_MIN, INT8_MAX));
  case SUPINE_VOXEL_U8:
    PUT(uint8_t, clip(values[i], 0, UINT8_MAX));
  case SUPINE_VOXEL_I16:
    PUT(int16_t, clip(values[i], INT16_MIN, INT16_MAX));
  case SUPINE_VOXEL_U16:
    PUT(uint16_t, clip(values[i], 0, UINT16_MAX));
  case SUPINE_VOXEL_I32:
    PUT(int32_t, clip(values[i], INT32_MIN, INT32_MAX));
  case SUPINE_VOXEL_U32:
    PUT(uint32_t, clip(values[i], 0, UINT32_MAX));
  case SUPINE_VOXEL_F32:
    PUT(float, values[i]);
  case SUPINE_VOXEL_F64:
  case SUPINE_VOXEL_COUNT:
    PUT(double, values[i]);
  }
}

void supine_image_locate(const supine_image *image, const double point[3], double voxel[3]) {
  const double whole = supine_triple(image->step[0], image->step[1], image->step[2]);
  double from[3];
  for (int k = 0; k < 3; ++k) {
    from[k] = point[k] - image->origin[k];
  }
  for (int a = 0; a < 3; ++a) { /* Cramer's rule */
    double replaced[3][3];
    memcpy(replaced, image->step, sizeof replaced);
    memcpy(replaced[a], from, sizeof from);
    voxel[a] = supine_triple(replaced[0], replaced[1], replaced[2]) / whole;
  }
}
