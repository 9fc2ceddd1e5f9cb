/* SPDX-License-Identifier: MIT */
/* Choose the reader of an image by the ending of the file's name, and check what it has read. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/input.h"
#include "base/locale.h"
#include "base/output.h"
#include "base/text.h"
#include "base/vec3.h"

#include "mesh/image/image_formats.h"

static const struct {
  const char *ending;
  image_describe *describe;
  image_write *write;
} formats[] = {{".nrrd", supine_image_describe_nrrd, supine_image_write_nrrd},
               {".nii", supine_image_describe_nifti, supine_image_write_nifti},
               {".nii.gz", supine_image_describe_nifti, supine_image_write_nifti},
               {".mha", supine_image_describe_mha, supine_image_write_mha}};

enum { FORMATS = sizeof formats / sizeof *formats };

static size_t format_of(const char *path) {
  size_t f = 0;
  while (f < FORMATS && !supine_text_ends_in(path, formats[f].ending)) {
    ++f;
  }
  return f;
}

bool supine_image_supports(const char *path) {
  return format_of(path) < FORMATS;
}

bool supine_image_is_named(const char *path) {
  static const char *const others[] = {".mhd", ".nhdr", ".mgz", ".dcm", ".hdr", ".img"};
  bool is = supine_image_supports(path);
  for (size_t i = 0; i < sizeof others / sizeof *others; ++i) {
    is = is || supine_text_ends_in(path, others[i]);
  }
  return is;
}

/* Return whether origin and steps are finite and the steps are linearly independent: the volume
 * they span must exceed a thousandth of the product of their lengths. */
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

supine_status supine_image_read(const char *path, supine_image *image, supine_error *error) {
  SUPINE_C_LOCALE; /* for the libraries that read headers */
  SUPINE_FREED_BY(supine_image_free) supine_image read = {.channels = 1};
  SUPINE_FREED_BY(supine_file_close) FILE *file = NULL;
  size_t size = 0;
  image_storage storage = {0};
  const bool dicom = supine_text_ends_in(path, ".dcm");
  SUPINE_REFUSE_IF(!dicom && !supine_image_supports(path), error, SUPINE_ERROR_FORMAT,
                   "%s: an image's name must end in .nrrd, .nii, .nii.gz or .mha, or .dcm for a "
                   "DICOM segmentation; convert other formats, for example with 3D Slicer",
                   path);
  SUPINE_TRY(supine_input_open(path, &file, &size, error));
  if (dicom) {
    SUPINE_TRY(supine_image_read_segmentation(path, &read, error));
    *image = read;
    read.values = NULL;
    return SUPINE_OK;
  }
  SUPINE_TRY(formats[format_of(path)].describe(path, file, &read, &storage, error));
  SUPINE_REFUSE_IF(!is_frame(&read), error, SUPINE_ERROR_FORMAT,
                   "%s: the header's axis directions are linearly dependent: write the image again",
                   path);
  SUPINE_TRY(supine_image_read_voxels(path, file, size, &storage, &read, error));
  *image = read;
  read.values = NULL;
  return SUPINE_OK;
}

/* Copy a field of displacements, and reverse the first axis of the copy. */
static supine_status reversed_copy(const supine_image *image, supine_image *copy,
                                   supine_error *error) {
  *copy = *image;
  copy->values = malloc(supine_image_bytes(image));
  if (copy->values == NULL) {
    return supine_error_memory(error, "%zu bytes of a field", supine_image_bytes(image));
  }
  memcpy(copy->values, image->values, supine_image_bytes(image));
  supine_image_reverse(copy, 0);
  return SUPINE_OK;
}

supine_status supine_image_write(const char *path, const supine_image *image, const char *note,
                                 supine_error *error) {
  SUPINE_REFUSE_IF(!supine_image_supports(path), error, SUPINE_ERROR_ARGUMENT,
                   "%s: end the name of an image in .nrrd, .nii, .nii.gz or .mha", path);
  SUPINE_FREED_BY(supine_image_free) supine_image turned = {0};
  if (image->channels == 3 && supine_image_is_left_handed(image)) {
    SUPINE_TRY(reversed_copy(image, &turned, error));
    image = &turned;
  }
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  SUPINE_TRY(supine_output_open(path, &output, error));
  const supine_status status =
      formats[format_of(path)].write(path, image, note, output.file, error);
  if (status == SUPINE_ERROR_MEMORY) {
    return supine_error_memory(error, "writing %s", path);
  }
  return status == SUPINE_OK ? supine_output_commit(&output, error) : status;
}
