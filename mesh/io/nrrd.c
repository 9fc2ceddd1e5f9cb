/* SPDX-License-Identifier: MIT */
/* Read and write NRRD through teem. */
#include <stdlib.h>
#include <string.h>

#include <teem/nrrd.h>

#include "sh/base/output.h"

#include "mesh/io/image_formats.h"

static const int types[SUPINE_VOXEL_COUNT] = {nrrdTypeChar,   nrrdTypeUChar, nrrdTypeShort,
                                              nrrdTypeUShort, nrrdTypeInt,   nrrdTypeUInt,
                                              nrrdTypeFloat,  nrrdTypeDouble};

/* Set the error to the last line of teem's message. */
static supine_status teem_fails(const char *path, supine_status status, supine_error *error) {
  char *text = biffGetDone(NRRD);
  char *last = text;
  for (char *at = text; at != NULL && *at != '\0'; ++at) {
    if (*at == '\n') {
      *at = '\0';
      last = at[1] != '\0' ? at + 1 : last;
    }
  }
  (void)supine_error_set(error, status, "%s: %s", path, last != NULL ? last : "malformed");
  free(text);
  return status;
}

static bool is_wide(const Nrrd *nrrd) {
  return nrrd->type == nrrdTypeLLong || nrrd->type == nrrdTypeULLong;
}

static supine_status check(const char *path, const Nrrd *nrrd, const NrrdIoState *io,
                           size_t file_size, supine_image *image, supine_error *error) {
  if (io->detachedHeader || io->dataFNFormat != NULL || io->dataFNArr->len > 0) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: the voxels are in another file; save them in one", path);
  }
  if (nrrd->dim != 3 || nrrd->spaceDim != 3) {
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        nrrd->dim != 3 ? "%s: %u axes; give an image with one number per voxel and three axes"
                       : "%s: the header has no space directions of its %u axes",
        path, nrrd->dim);
  }
  double turn = 0.0;
  switch (nrrd->space) {
  case nrrdSpaceLeftPosteriorSuperior:
    turn = 1.0;
    break;
  case nrrdSpaceRightAnteriorSuperior:
    turn = -1.0;
    break;
  default:
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: its space is neither left-posterior-superior nor "
                            "right-anterior-superior; write it in one of them",
                            path);
  }
  size_t type = 0;
  while (type < SUPINE_VOXEL_COUNT &&
         types[type] != (is_wide(nrrd) ? nrrdTypeDouble : nrrd->type)) {
    ++type;
  }
  if (type == SUPINE_VOXEL_COUNT) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: voxels of type %s are not read; convert them to int16", path,
                            airEnumStr(nrrdType, nrrd->type));
  }
  image->voxel = (supine_image_voxel)type;
  image->axes = turn > 0.0 ? SUPINE_AXES_LPS : SUPINE_AXES_RAS;
  image->frame_source = "space directions";
  for (unsigned a = 0; a < 3; ++a) {
    image->size[a] = nrrd->axis[a].size;
    for (int k = 0; k < 3; ++k) {
      image->step[a][k] = (k < 2 ? turn : 1.0) * nrrd->axis[a].spaceDirection[k];
    }
    image->origin[a] = (a < 2 ? turn : 1.0) * nrrd->spaceOrigin[a];
  }
  return supine_image_check_size(path, image, file_size, error);
}

/* Return the number of bytes before the voxels: the header ends with an empty line. */
static long header_length(const char *path) {
  FILE *file = fopen(path, "rb");
  int before = 0;
  long length = 0;
  for (int c; file != NULL && (c = fgetc(file)) != EOF;) {
    ++length;
    if (c == '\n' && before == '\n') {
      break;
    }
    before = c == '\r' ? before : c;
  }
  if (file != NULL) {
    (void)fclose(file);
  }
  return length;
}

supine_status supine_image_read_nrrd(const char *path, size_t file_size, supine_image *image,
                                     supine_error *error) {
  Nrrd *nrrd = nrrdNew();
  NrrdIoState *io = nrrdIoStateNew();
  supine_status status = SUPINE_OK;
  if (nrrd == NULL || io == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
    goto cleanup;
  }
  io->skipData = AIR_TRUE; /* only the header, before allocating what it asks for */
  if (nrrdLoad(nrrd, path, io) != 0) {
    status = teem_fails(path, SUPINE_ERROR_FORMAT, error);
    goto cleanup;
  }
  status = check(path, nrrd, io, file_size, image, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  if (io->encoding == nrrdEncodingGzip) {
    status = supine_image_check_gzip(path, header_length(path), error);
    if (status != SUPINE_OK) {
      goto cleanup;
    }
  }
  nrrdIoStateInit(io);
  if (nrrdLoad(nrrd, path, io) != 0) {
    status = teem_fails(path, SUPINE_ERROR_FORMAT, error);
    goto cleanup;
  }
  image->values = nrrd->data; /* from malloc: teem allocates with calloc */
  nrrd->data = NULL;
  if (is_wide(nrrd)) {
    supine_image_widen(image->values, image->size[0] * image->size[1] * image->size[2],
                       nrrd->type == nrrdTypeLLong);
  }
cleanup:
  if (io != NULL) {
    (void)nrrdIoStateNix(io);
  }
  (void)nrrdNuke(nrrd);
  return status;
}

/* Describe the image in the header: axes, space, kinds. */
static bool describe(Nrrd *nrrd, const supine_image *image, const char *note) {
  const unsigned vector = image->channels > 1;
  size_t sizes[4] = {image->channels, image->size[0], image->size[1], image->size[2]};
  if (nrrdWrap_nva(nrrd, image->values, types[image->voxel], 3 + vector, sizes + 1 - vector) != 0 ||
      nrrdSpaceSet(nrrd, nrrdSpaceLeftPosteriorSuperior) != 0) {
    return false;
  }
  for (unsigned a = 0; a < 3; ++a) {
    nrrd->spaceOrigin[a] = image->origin[a];
    nrrd->axis[a + vector].kind = nrrdKindDomain;
    for (int k = 0; k < 3; ++k) {
      nrrd->axis[a + vector].spaceDirection[k] = image->step[a][k];
    }
  }
  if (vector != 0) {
    nrrd->axis[0].kind = nrrdKindVector;
    for (int k = 0; k < NRRD_SPACE_DIM_MAX; ++k) {
      nrrd->axis[0].spaceDirection[k] = AIR_NAN;
    }
  }
  return note == NULL || nrrdCommentAdd(nrrd, note) == 0;
}

supine_status supine_image_write_nrrd(const char *path, const supine_image *image, const char *note,
                                      supine_error *error) {
  supine_output output = {0};
  Nrrd *nrrd = nrrdNew();
  NrrdIoState *io = nrrdIoStateNew();
  supine_status status = SUPINE_ERROR_MEMORY;
  if (nrrd == NULL || io == NULL || !describe(nrrd, image, note)) {
    status = teem_fails(path, status, error);
    goto cleanup;
  }
  status = supine_output_open(path, &output, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  (void)nrrdIoStateEncodingSet(io, nrrdEncodingGzip);
  if (nrrdWrite(output.file, nrrd, io) != 0) {
    status = teem_fails(path, SUPINE_ERROR_WRITE, error);
    supine_output_abandon(&output);
    goto cleanup;
  }
  status = supine_output_commit(&output, error);
cleanup:
  if (io != NULL) {
    (void)nrrdIoStateNix(io);
  }
  if (nrrd != NULL) {
    (void)nrrdNix(nrrd); /* not the voxels */
  }
  return status;
}
