/* SPDX-License-Identifier: MIT */
/* Read NIfTI through libnifti2, and write NIfTI-1. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <nifti2_io.h>
#include <supine/inputs.h>

#include "base/arena.h"
#include "base/text.h"
#include "base/vec3.h"

#include "mesh/image/image_formats.h"

static const int types[SUPINE_VOXEL_COUNT] = {DT_INT8,  DT_UINT8,  DT_INT16,   DT_UINT16,
                                              DT_INT32, DT_UINT32, DT_FLOAT32, DT_FLOAT64};

/* Return whether qform and sform place a corner of the image half a voxel or more apart. */
static bool forms_differ(const nifti_image *nifti) {
  const double size[3] = {(double)nifti->nx, (double)nifti->ny, (double)nifti->nz};
  const double voxel = fmin(fabs(nifti->dx), fmin(fabs(nifti->dy), fabs(nifti->dz)));
  double farthest = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    double apart = 0.0;
    for (int k = 0; k < 3; ++k) {
      double difference = nifti->sto_xyz.m[k][3] - nifti->qto_xyz.m[k][3];
      for (int a = 0; a < 3; ++a) {
        difference +=
            (corner >> a & 1) * (size[a] - 1.0) * (nifti->sto_xyz.m[k][a] - nifti->qto_xyz.m[k][a]);
      }
      apart += difference * difference;
    }
    farthest = fmax(farthest, sqrt(apart));
  }
  return nifti->sform_code > 0 && nifti->qform_code > 0 && farthest >= 0.5 * voxel;
}

/* Check the image's size and type. Convert origin and steps from RAS, NIfTI's axes, to LPS. */
static supine_status check(const char *path, const nifti_image *nifti, bool packed,
                           supine_image *image, image_storage *storage, supine_error *error) {
  double unit = 1.0; /* mm */
  if (nifti->xyz_units == NIFTI_UNITS_METER) {
    unit = 1000.0;
  } else if (nifti->xyz_units == NIFTI_UNITS_MICRON) {
    unit = 1e-3;
  }
  const nifti_dmat44 *m = nifti->sform_code > 0 ? &nifti->sto_xyz : &nifti->qto_xyz;
  const int64_t size[3] = {nifti->nx, nifti->ny, nifti->nz};
  size_t type = 0;
  SUPINE_REFUSE_IF(
      nifti->ndim < 3 || nifti->nx * nifti->ny * nifti->nz != nifti->nvox, error,
      SUPINE_ERROR_FORMAT,
      "%s: ndim is %d; give an image with one number per voxel, three axes and one volume", path,
      (int)nifti->ndim);
  SUPINE_REFUSE_IF(nifti->sform_code <= 0 && nifti->qform_code <= 0, error, SUPINE_ERROR_FORMAT,
                   "%s: the header has no orientation (qform and sform are 0); give the file that "
                   "the segmenter wrote, or copy qform or sform from the scan that was segmented",
                   path);
  const bool wide = nifti->datatype == DT_INT64 || nifti->datatype == DT_UINT64;
  while (type < SUPINE_VOXEL_COUNT && types[type] != (wide ? DT_FLOAT64 : nifti->datatype)) {
    ++type;
  }
  SUPINE_REFUSE_IF(type == SUPINE_VOXEL_COUNT, error, SUPINE_ERROR_FORMAT,
                   "%s: voxels of type %s are not supported; convert them to int16", path,
                   nifti_datatype_string(nifti->datatype));
  image->voxel = (supine_image_voxel)type;
  image->axes = SUPINE_AXES_RAS;
  image->frame_source = nifti->sform_code > 0 ? "sform" : "qform";
  image->frames_differ = forms_differ(nifti);
  for (int k = 0; k < 3; ++k) {
    const double turn = k < 2 ? -unit : unit;
    image->size[k] = size[k] > 0 ? (size_t)size[k] : 0;
    image->origin[k] = turn * m->m[k][3];
    for (int a = 0; a < 3; ++a) {
      image->step[a][k] = turn * m->m[k][a];
    }
  }
  int integer = 0; /* 1: int64, -1: uint64 */
  if (nifti->datatype == DT_INT64) {
    integer = 1;
  } else if (nifti->datatype == DT_UINT64) {
    integer = -1;
  }
  *storage = (image_storage){.offset = packed ? 0 : nifti->iname_offset,
                             .skip = packed ? nifti->iname_offset : 0,
                             .packed = packed,
                             .big_endian = nifti->byteorder != nifti_short_order(),
                             .integer = integer,
                             .slope = nifti->scl_slope,
                             .intercept = nifti->scl_inter};
  return SUPINE_OK;
}

/* What the header itself states: libnifti2 takes other values for those that are impossible. */
typedef struct stated {
  bool first;    /* whether it is NIfTI-1 */
  double offset; /* where the voxels begin, bytes */
  double spacing[3];
  int sform, qform; /* codes */
} stated;

#define STATED(header)                                                                             \
  ((stated){.first = sizeof *(header) == sizeof(nifti_1_header),                                   \
            .offset = (double)(header)->vox_offset,                                                \
            .spacing = {(double)(header)->pixdim[1], (double)(header)->pixdim[2],                  \
                        (double)(header)->pixdim[3]},                                              \
            .sform = (header)->sform_code,                                                         \
            .qform = (header)->qform_code})

/* Read what the header states. Return false if there is no header. */
static bool read_stated(const char *path, stated *found) {
  enum { NIFTI_1 = 1 };
  int version = 0;
  int swapped = 0;
  bool exists = false;
  free(nifti_read_header(path, &version, 1)); /* finds the version, but leaves bytes unswapped */
  if (version == NIFTI_1) {
    nifti_1_header *header = nifti_read_n1_hdr(path, &swapped, 1);
    exists = header != NULL;
    if (exists) {
      *found = STATED(header);
    }
    free(header);
  } else {
    nifti_2_header *header = nifti_read_n2_hdr(path, &swapped, 1);
    exists = header != NULL;
    if (exists) {
      *found = STATED(header);
    }
    free(header);
  }
  return exists;
}

/* Refuse a header that does not say where the voxels begin or how far apart they are: libnifti2
 * would take other bytes, or 1 mm. */
static supine_status check_stated(const char *path, supine_error *error) {
  stated head = {.first = true};
  const bool found = read_stated(path, &head);
  const double least = head.first ? 352.0 : 544.0; /* bytes of the header and the extension flag */
  SUPINE_REFUSE_IF(!found, error, SUPINE_ERROR_FORMAT, "%s: not a NIfTI header; give a NIfTI file",
                   path);
  const bool begins =
      supine_input_judge(SUPINE_INPUT_VOXELS_BEGIN, head.offset / least) == SUPINE_INPUT_TAKEN &&
      head.offset <= (double)INT32_MAX && head.offset == floor(head.offset);
  SUPINE_REFUSE_IF(!begins, error, SUPINE_ERROR_FORMAT,
                   "%s: its vox_offset is %g, but voxels begin at a whole byte from %.0f; write "
                   "the image again",
                   path, head.offset, least);
  for (int a = 0; a < 3; ++a) { /* a qform has no lengths of its own */
    const bool needed = head.sform <= 0 && head.qform > 0;
    SUPINE_REFUSE_IF(
        needed && !(head.spacing[a] > 0.0 && isfinite(head.spacing[a])), error, SUPINE_ERROR_FORMAT,
        "%s: pixdim[%d], the voxel size, is %g, and the header has no sform: write the image with "
        "its voxel size, or copy sform from the scan that was segmented",
        path, a + 1, head.spacing[a]);
  }
  return SUPINE_OK;
}

supine_status supine_image_describe_nifti(const char *path, FILE *file, supine_image *image,
                                          image_storage *storage, supine_error *error) {
  unsigned char head[2] = {0};
  const size_t known = fread(head, 1, sizeof head, file);
  const bool packed = known == sizeof head && head[0] == 0x1F && head[1] == 0x8B; /* gzip */
  nifti_set_debug_level(0);
  /* the header of a pair of files says so, but nifti_image_read takes its own bytes for voxels */
  SUPINE_REFUSE_IF(is_nifti_file(path) == 2, error, SUPINE_ERROR_FORMAT,
                   "%s: its voxels are in another file; save header and voxels in one .nii", path);
  SUPINE_TRY(check_stated(path, error));
  nifti_image *nifti = nifti_image_read(path, 0);
  SUPINE_REFUSE_IF(nifti == NULL, error, SUPINE_ERROR_FORMAT,
                   "%s: not a NIfTI header; give a NIfTI file", path);
  const supine_status status = check(path, nifti, packed, image, storage, error);
  nifti_image_free(nifti);
  return status;
}

/* Make the header: 348 bytes, then four zero bytes, which say that no extension follows. */
static void make_header(const supine_image *image, const char *note, unsigned char header[352]) {
  nifti_1_header h = {0};
  static const short bits[SUPINE_VOXEL_COUNT] = {8, 8, 16, 16, 32, 32, 32, 64};
  float *rows[3] = {h.srow_x, h.srow_y, h.srow_z};
  h.sizeof_hdr = 348;
  h.dim[0] = 3;
  h.datatype = (short)types[image->voxel];
  h.bitpix = bits[image->voxel];
  h.vox_offset = 352.0F;
  h.scl_slope = 1.0F;
  h.xyzt_units = NIFTI_UNITS_MM;
  h.sform_code = NIFTI_XFORM_SCANNER_ANAT;
  h.pixdim[0] = 1.0F;
  for (int a = 0; a < 7; ++a) {
    h.dim[1 + a] = 1;
  }
  for (int a = 0; a < 3; ++a) {
    const double *s = image->step[a];
    h.dim[1 + a] = (short)image->size[a];
    h.pixdim[1 + a] = (float)supine_length(s);
    for (int k = 0; k < 3; ++k) {
      rows[k][a] = (float)(k < 2 ? -s[k] : s[k]);
    }
    rows[a][3] = (float)(a < 2 ? -image->origin[a] : image->origin[a]);
  }
  if (image->channels == 3) { /* NIfTI stores the components of vectors along the fifth axis */
    h.dim[0] = 5;
    h.dim[5] = 3;
    h.pixdim[4] = h.pixdim[5] = 1.0F;
    h.intent_code = NIFTI_INTENT_VECTOR;
  }
  (void)snprintf(h.descrip, sizeof h.descrip, "%.79s", note != NULL ? note : "");
  memcpy(h.magic, "n+1", 4);
  memset(header, 0, 352);
  memcpy(header, &h, sizeof h);
}

/* Copy the vectors: first all x, then all y, then all z. Return NULL if out of memory. The vectors
 * stay in LPS: ITK and ANTs do not convert NIFTI_INTENT_VECTOR, and ITK before 5.3 reads only the
 * first component of NIFTI_INTENT_DISPVECT. */
static float *planes(const supine_image *image, supine_arena *arena) {
  const size_t count = supine_image_count(image);
  float *made = supine_arena_take(arena, 3 * count, sizeof *made);
  if (made != NULL) {
    for (size_t i = 0; i < 3 * count; ++i) {
      made[i % 3 * count + i / 3] = (float)supine_image_get(image, i);
    }
  }
  return made;
}

supine_status supine_image_write_nifti(const char *path, const supine_image *image,
                                       const char *note, FILE *file, supine_error *error) {
  unsigned char header[352];
  const bool vectors = image->channels == 3 && image->voxel == SUPINE_VOXEL_F32;
  SUPINE_REFUSE_IF((image->channels != 1 && !vectors) || image->size[0] > INT16_MAX ||
                       image->size[1] > INT16_MAX || image->size[2] > INT16_MAX,
                   error, SUPINE_ERROR_ARGUMENT,
                   "%s: NIfTI-1 holds one number or a 3-vector per voxel, and at most %d voxels "
                   "along an axis: save it as .nrrd",
                   path, INT16_MAX);
  SUPINE_ARENA arena = {0};
  const void *values = vectors ? planes(image, &arena) : image->values;
  if (arena.failed) {
    return SUPINE_ERROR_MEMORY;
  }
  make_header(image, note, header);
  if (supine_text_ends_in(path, ".gz")) {
    return supine_image_pack(IMAGE_GZIP, header, sizeof header, image, values, file);
  }
  (void)fwrite(header, 1, sizeof header, file);
  (void)fwrite(values, 1, supine_image_bytes(image), file);
  return SUPINE_OK;
}
