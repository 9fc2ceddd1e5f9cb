/* SPDX-License-Identifier: MIT */
/* Choose the reader of an image by the ending of the file's name, and check what it has read. */
#include <errno.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>

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
  struct stat file = {0};
  supine_image read = {.channels = 1};
  image_storage storage = {0};
  if (!supine_image_supports(path)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: an image's name must end in .nrrd, .nii, .nii.gz or .mha; convert "
                            "other formats, for example with 3D Slicer",
                            path);
  }
  if (stat(path, &file) != 0 || !S_ISREG(file.st_mode)) {
    return supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot read: %s", path,
                            file.st_mode == 0 ? strerror(errno) : "it is not a regular file");
  }
  supine_status status = formats[format_of(path)].describe(path, &read, &storage, error);
  if (status == SUPINE_OK && !is_frame(&read)) {
    status = supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: the header's axis directions are linearly dependent: write the image again", path);
  }
  if (status == SUPINE_OK) {
    status = supine_image_read_voxels(path, (size_t)file.st_size, &storage, &read, error);
  }
  if (status != SUPINE_OK) {
    supine_image_free(&read);
    return status;
  }
  *image = read;
  return SUPINE_OK;
}

supine_status supine_image_write(const char *path, const supine_image *image, const char *note,
                                 supine_error *error) {
  if (!supine_image_supports(path)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%s: end the name of an image in .nrrd, .nii, .nii.gz or .mha", path);
  }
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status == SUPINE_OK) {
    status = formats[format_of(path)].write(path, image, note, output.file, error);
    if (status == SUPINE_ERROR_MEMORY) {
      (void)supine_error_set(error, status, "%s: out of memory", path);
    }
    if (status == SUPINE_OK) {
      return supine_output_commit(&output, error);
    }
    supine_output_abandon(&output);
  }
  return status;
}
