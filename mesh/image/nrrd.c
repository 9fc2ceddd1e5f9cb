/* SPDX-License-Identifier: MIT */
/* Read NRRD headers through teem, and write NRRD. */
#include <stdlib.h>

#include <teem/nrrd.h>

#include "base/arena.h"
#include "base/library.h"
#include "base/number.h"
#include "mesh/image/image_formats.h"

/* clang-format off */
#define FUNCTIONS(EACH)                                                                            \
  EACH(, nrrdBiffKey) EACH(, nrrdType) EACH(, nrrdEncodingAscii) EACH(, nrrdEncodingGzip)          \
  EACH(, nrrdEncodingRaw) EACH(, nrrdNew) EACH(, nrrdIoStateNew) EACH(, nrrdRead)                  \
  EACH(, nrrdIoStateNix) EACH(, nrrdNuke) EACH(, biffGetDone) EACH(, airEnumStr)
/* clang-format on */
static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } teem;

static const struct {
  int type;
  const char *name;
} types[SUPINE_VOXEL_COUNT] = {{nrrdTypeChar, "int8"},   {nrrdTypeUChar, "uint8"},
                               {nrrdTypeShort, "int16"}, {nrrdTypeUShort, "uint16"},
                               {nrrdTypeInt, "int32"},   {nrrdTypeUInt, "uint32"},
                               {nrrdTypeFloat, "float"}, {nrrdTypeDouble, "double"}};

static supine_status malformed(const char *path, const char *what, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: %s", path, what);
}

/* Set the error to the last line of teem's message. */
static supine_status teem_fails(const char *path, supine_error *error) {
  char *text = teem.biffGetDone(*teem.nrrdBiffKey);
  char *last = text;
  for (char *at = text; at != NULL && *at != '\0'; ++at) {
    if (*at == '\n') {
      *at = '\0';
      last = at[1] != '\0' ? at + 1 : last;
    }
  }
  (void)supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: %s; write the image again", path,
                         last != NULL ? last : "malformed");
  free(text);
  return SUPINE_ERROR_FORMAT;
}

static supine_status check(const char *path, const Nrrd *nrrd, const NrrdIoState *io,
                           supine_image *image, image_storage *storage, supine_error *error) {
  if (io->detachedHeader || io->dataFNFormat != NULL || io->dataFNArr->len > 0) {
    return malformed(path, "its voxels are in another file; save all in one file", error);
  }
  SUPINE_REFUSE_IF(nrrd->dim != 3 || nrrd->spaceDim != 3, error, SUPINE_ERROR_FORMAT,
                   nrrd->dim != 3
                       ? "%s: dimension %u; give an image with one number per voxel and three axes"
                       : "%s: the header lacks space directions for its %u axes; add them",
                   path, nrrd->dim);
  const double turn = nrrd->space == nrrdSpaceLeftPosteriorSuperior   ? 1.0
                      : nrrd->space == nrrdSpaceRightAnteriorSuperior ? -1.0
                                                                      : 0.0;
  if (turn == 0.0) {
    return malformed(path,
                     "its space is neither left-posterior-superior nor right-anterior-superior; "
                     "convert the image to one of them",
                     error);
  }
  storage->packed = io->encoding == *teem.nrrdEncodingGzip;
  storage->text = io->encoding == *teem.nrrdEncodingAscii;
  if ((io->encoding != *teem.nrrdEncodingRaw && !storage->packed && !storage->text) ||
      io->lineSkip != 0 || io->byteSkip != 0) {
    return malformed(path,
                     "its encoding is not raw, gzip or ascii, or its header skips lines or bytes; "
                     "save the image again as gzip",
                     error);
  }
  const bool wide = nrrd->type == nrrdTypeLLong || nrrd->type == nrrdTypeULLong;
  size_t type = 0;
  while (type < SUPINE_VOXEL_COUNT && types[type].type != (wide ? nrrdTypeDouble : nrrd->type)) {
    ++type;
  }
  SUPINE_REFUSE_IF(type == SUPINE_VOXEL_COUNT, error, SUPINE_ERROR_FORMAT,
                   "%s: voxels of type %s are not supported; convert them to int16", path,
                   teem.airEnumStr(*teem.nrrdType, nrrd->type));
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
  storage->big_endian = io->endian == airEndianBig;
  storage->integer = !wide ? 0 : nrrd->type == nrrdTypeLLong ? 1 : -1;
  return SUPINE_OK;
}

supine_status supine_image_describe_nrrd(const char *path, FILE *file, supine_image *image,
                                         image_storage *storage, supine_error *error) {
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_TEEM, FUNCTIONS, &teem, error));
  Nrrd *nrrd = teem.nrrdNew();
  NrrdIoState *io = teem.nrrdIoStateNew();
  supine_status status = SUPINE_ERROR_MEMORY;
  if (nrrd == NULL || io == NULL) {
    (void)supine_error_memory(error, "the header of %s", path);
  } else {
    io->skipData = AIR_TRUE;
    io->keepNrrdDataFileOpen = AIR_TRUE;
    status = teem.nrrdRead(nrrd, file, io) != 0 ? teem_fails(path, error)
                                                : check(path, nrrd, io, image, storage, error);
    storage->offset = ftello(file);
  }
  if (io != NULL) {
    (void)teem.nrrdIoStateNix(io);
  }
  (void)teem.nrrdNuke(nrrd);
  return status;
}

supine_status supine_image_write_nrrd(const char *path, const supine_image *image, const char *note,
                                      FILE *file, supine_error *error) {
  const bool vector = image->channels > 1;
  (void)path;
  (void)error;
  (void)fprintf(file, "NRRD0004\n%s%s%stype: %s\ndimension: %d\nsizes:", note != NULL ? "# " : "",
                note != NULL ? note : "", note != NULL ? "\n" : "", types[image->voxel].name,
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
