/* SPDX-License-Identifier: MIT */
/* Read and write the voxels of all image formats: plain, or compressed by zlib or gzip. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ZLIB_CONST /* makes zlib declare next_in const */
#include <zlib.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/number.h"

#include "mesh/image/image_formats.h"

enum { PIECE = 1 << 16, ANY_HEADER = 32 };

/* Unpack a stream, checking its checksums: drop `skip` bytes, store `size` bytes in `values`. */
static bool inflate_into(FILE *file, uint64_t skip, unsigned char *values, size_t size) {
  unsigned char packed[PIECE];
  unsigned char discarded[PIECE];
  z_stream z = {.avail_in = 0};
  uint64_t unpacked = 0;
  const uint64_t end = skip + size;
  int result = inflateInit2(&z, ANY_HEADER + MAX_WBITS);
  while (result == Z_OK) {
    if (z.avail_in == 0) {
      z.next_in = packed;
      z.avail_in = (unsigned)fread(packed, 1, PIECE, file);
    }
    const bool wanted = unpacked >= skip && unpacked < end;
    const uint64_t room = wanted ? end - unpacked : unpacked < skip ? skip - unpacked : PIECE;
    const unsigned given = (unsigned)(room < PIECE ? room : PIECE);
    z.next_out = wanted ? values + (unpacked - skip) : discarded;
    z.avail_out = given;
    result = inflate(&z, Z_NO_FLUSH); /* returns Z_BUF_ERROR at the end of the file */
    unpacked += given - z.avail_out;
    if (result == Z_STREAM_END && unpacked < end) { /* another compressed stream follows */
      result = inflateReset(&z);
    }
  }
  (void)inflateEnd(&z);
  return result == Z_STREAM_END;
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

static void widen(unsigned char *at, size_t count, bool is_signed) {
  for (size_t i = 0; i < count; ++i, at += 8) {
    int64_t number = 0;
    memcpy(&number, at, sizeof number);
    const double value = is_signed ? (double)number : (double)(uint64_t)number;
    memcpy(at, &value, sizeof value);
  }
}

/* Convert the voxels to F32 as slope x number + intercept, unless that changes nothing. */
static supine_status rescale(const char *path, const image_storage *storage, supine_image *image,
                             supine_error *error) {
  const double slope = storage->slope;
  const double intercept = storage->intercept;
  if (slope == 0.0 || !isfinite(slope) || !isfinite(intercept) ||
      (slope == 1.0 && intercept == 0.0)) {
    return SUPINE_OK;
  }
  const size_t count = image->size[0] * image->size[1] * image->size[2];
  float *values = malloc(count * sizeof *values);
  if (values == NULL) {
    return supine_error_memory(error, "%zu voxels of %s", count, path);
  }
  for (size_t i = 0; i < count; ++i) {
    values[i] = (float)(slope * supine_image_get(image, i) + intercept);
  }
  free(image->values);
  image->values = values;
  image->voxel = SUPINE_VOXEL_F32;
  return SUPINE_OK;
}

bool supine_image_number(const char **text, double *value) {
  char *end = NULL;
  *value = supine_number_parse(*text, &end);
  const bool found = end != *text;
  *text = end;
  return found;
}

/* Read the next word between blanks; return false at the end of the file, or if it is too long. */
static bool read_word(FILE *file, char *word, size_t size) {
  size_t length = 0;
  int c = getc(file);
  while (c != EOF && supine_ascii_is_space((char)c)) {
    c = getc(file);
  }
  while (c != EOF && !supine_ascii_is_space((char)c) && length < size - 1) {
    word[length++] = (char)c;
    c = getc(file);
  }
  word[length] = '\0';
  return length > 0 && (c == EOF || supine_ascii_is_space((char)c));
}

static bool read_text(FILE *file, supine_image *image, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    char word[64];
    const char *at = word;
    double value = 0.0;
    if (!read_word(file, word, sizeof word) || !supine_image_number(&at, &value) || *at != '\0') {
      return false;
    }
    supine_image_put(image, i, 1, &value);
  }
  return true;
}

supine_status supine_image_read_voxels(const char *path, FILE *file, size_t file_size,
                                       const image_storage *storage, supine_image *image,
                                       supine_error *error) {
  static const double gzip_ratio = 1032.0; /* largest ratio of unpacked to packed size */
  const size_t each = supine_image_voxel_size(image->voxel);
  const double bytes =
      (double)image->size[0] * (double)image->size[1] * (double)image->size[2] * (double)each;
  SUPINE_REFUSE_IF(!(bytes > 0.0 && bytes <= gzip_ratio * (double)file_size), error,
                   SUPINE_ERROR_FORMAT,
                   "%s: %zu x %zu x %zu voxels do not fit in %zu bytes: the file is truncated; "
                   "fetch or write it again",
                   path, image->size[0], image->size[1], image->size[2], file_size);
  const size_t count = image->size[0] * image->size[1] * image->size[2];
  image->values = malloc(count * each);
  if (image->values == NULL) {
    return supine_error_memory(error, "%zu voxels of %s", count, path);
  }
  SUPINE_REFUSE_IF(fseeko(file, storage->offset, SEEK_SET) != 0 ||
                       !(storage->packed ? inflate_into(file, (uint64_t)storage->skip,
                                                        image->values, count * each)
                         : storage->text ? read_text(file, image, count)
                                         : fread(image->values, each, count, file) == count),
                   error, SUPINE_ERROR_FORMAT,
                   "%s: truncated or damaged; fetch or write the file again", path);
  if (storage->big_endian && !storage->text) {
    swap_bytes(image->values, count, each);
  }
  if (storage->integer != 0 && !storage->text) {
    widen(image->values, count, storage->integer > 0);
  }
  return rescale(path, storage, image, error);
}

supine_status supine_image_pack(int format, const void *head, size_t head_size,
                                const supine_image *image, const void *values, FILE *file) {
  enum { MEMORY = 8, MOST = 1 << 28 };
  unsigned char packed[PIECE];
  z_stream z = {.next_in = head, .avail_in = (unsigned)head_size};
  const unsigned char *at = values;
  size_t left = supine_image_bytes(image);
  int result = deflateInit2(&z, format == IMAGE_ZLIB ? 3 : 6, Z_DEFLATED, format, MEMORY,
                            Z_DEFAULT_STRATEGY);
  while (result == Z_OK) {
    if (z.avail_in == 0 && left > 0) {
      z.next_in = at;
      z.avail_in = (unsigned)(left < MOST ? left : MOST);
      at += z.avail_in;
      left -= z.avail_in;
    }
    z.next_out = packed;
    z.avail_out = PIECE;
    result = deflate(&z, left == 0 ? Z_FINISH : Z_NO_FLUSH);
    (void)fwrite(packed, 1, PIECE - z.avail_out, file);
  }
  (void)deflateEnd(&z);
  return result == Z_STREAM_END ? SUPINE_OK : SUPINE_ERROR_MEMORY;
}
