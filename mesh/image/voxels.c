/* SPDX-License-Identifier: MIT */
/* Read and write the voxels of all image formats: plain, or compressed as zlib or gzip. libdeflate
 * does that for whole buffers, several times as fast as zlib; zlib reads what it does not: several
 * streams one after another, and streams with more than the voxels. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ZLIB_CONST /* makes zlib declare next_in const */
#include <libdeflate.h>
#include <zlib.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/number.h"

#include "mesh/image/image_formats.h"

enum { PIECE = 1 << 16, ANY_HEADER = 32 };

/* Unpack a whole file from its offset on, which must be one stream of exactly `skip` + `size` bytes
 * with the right checksum. Return false if it is not, or if the memory is short. */
static bool unpack_whole(FILE *file, size_t packed_size, size_t skip, unsigned char *values,
                         size_t size) {
  SUPINE_ARENA arena = {0};
  unsigned char *packed = supine_arena_take(&arena, packed_size, 1);
  unsigned char *unpacked = skip > 0 ? supine_arena_take(&arena, skip + size, 1) : values;
  struct libdeflate_decompressor *unpacker = libdeflate_alloc_decompressor();
  bool good = !arena.failed && unpacker != NULL && packed_size > 2 &&
              fread(packed, 1, packed_size, file) == packed_size;
  if (good) {
    size_t used = 0;
    const bool gzip = packed[0] == 0x1f && packed[1] == 0x8b;
    enum libdeflate_result result;
    if (gzip) {
      result = libdeflate_gzip_decompress_ex(unpacker, packed, packed_size, unpacked, skip + size,
                                             &used, NULL);
    } else {
      result = libdeflate_zlib_decompress_ex(unpacker, packed, packed_size, unpacked, skip + size,
                                             &used, NULL);
    }
    good = result == LIBDEFLATE_SUCCESS && used == packed_size;
  }
  if (good && skip > 0) {
    memcpy(values, unpacked + skip, size);
  }
  libdeflate_free_decompressor(unpacker);
  return good;
}

/* Unpack a stream, checking its checksums: drop `skip` bytes, store `size` bytes in `values`, and
 * count the bytes after them. */
static bool inflate_into(FILE *file, uint64_t skip, unsigned char *values, size_t size,
                         uint64_t *after) {
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
    uint64_t room = PIECE;
    if (wanted) {
      room = end - unpacked;
    } else if (unpacked < skip) {
      room = skip - unpacked;
    }
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
  *after = unpacked > end ? unpacked - end : 0;
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
  const size_t count = supine_image_count(image);
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

/* Return the value of a hexadecimal digit, or 16 for any other character. */
static unsigned digit_of(int c) {
  static const char digits[] = "0123456789abcdef";
  const char *at = c > 0 && c < 128 ? strchr(digits, c < 'a' && c > '9' ? c + 32 : c) : NULL;
  return at != NULL ? (unsigned)(at - digits) : 16;
}

/* Read `size` bytes as pairs of hexadecimal digits; blanks between them are skipped. */
static bool read_hex(FILE *file, unsigned char *bytes, size_t size) {
  for (size_t i = 0; i < 2 * size; ++i) {
    int c = getc(file);
    while (c != EOF && supine_ascii_is_space((char)c)) {
      c = getc(file);
    }
    const unsigned digit = digit_of(c);
    if (digit == 16) {
      return false;
    }
    bytes[i / 2] = (unsigned char)(i % 2 == 0 ? digit << 4 : bytes[i / 2] | digit);
  }
  return true;
}

/* Count the bytes left in a file: all, or those that are no blanks. Stop at `most`. */
static size_t count_left(FILE *file, bool text, size_t most) {
  size_t left = 0;
  for (int c = getc(file); c != EOF && left < most; c = getc(file)) {
    left += text && supine_ascii_is_space((char)c) ? 0 : 1;
  }
  return left;
}

/* Read the numbers as the file stores them; return false if it is damaged.
 * @param more  whether as many bytes follow as a plane has, so that they are no padding */
static bool read_numbers(FILE *file, size_t file_size, const image_storage *storage,
                         supine_image *image, bool *more) {
  const size_t each = supine_image_voxel_size(image->voxel);
  const size_t plane = image->size[0] * image->size[1];
  const size_t count = plane * image->size[2];
  *more = false;
  if (fseeko(file, storage->offset, SEEK_SET) != 0) {
    return false;
  }
  if (!storage->packed) {
    bool good = false;
    if (storage->text) {
      good = read_text(file, image, count);
    } else if (storage->hex) {
      good = read_hex(file, image->values, each * count);
    } else {
      good = fread(image->values, each, count, file) == count;
    }
    *more = count_left(file, storage->text || storage->hex, each * plane) == each * plane;
    return good;
  }
  const uint64_t before = (uint64_t)storage->offset;
  const uint64_t skip = (uint64_t)storage->skip;
  const bool small_skip = skip <= UINT16_MAX; /* the header of a NIfTI file, not hostile numbers */
  if (before < file_size && small_skip &&
      unpack_whole(file, file_size - (size_t)before, (size_t)skip, image->values, count * each)) {
    return true;
  }
  uint64_t after = 0;
  const bool good = fseeko(file, storage->offset, SEEK_SET) == 0 &&
                    inflate_into(file, skip, image->values, count * each, &after);
  *more = after >= each * plane;
  return good;
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
  const size_t count = supine_image_count(image);
  image->values = malloc(count * each);
  if (image->values == NULL) {
    return supine_error_memory(error, "%zu voxels of %s", count, path);
  }
  bool more = false;
  const bool good = read_numbers(file, file_size, storage, image, &more);
  SUPINE_REFUSE_IF(!good, error, SUPINE_ERROR_FORMAT,
                   "%s: truncated or damaged; fetch or write the file again", path);
  SUPINE_REFUSE_IF(
      more, error, SUPINE_ERROR_FORMAT,
      "%s: it holds more voxels than the %zu x %zu x %zu that its header counts: write "
      "the image again",
      path, image->size[0], image->size[1], image->size[2]);
  if (storage->big_endian && !storage->text) {
    swap_bytes(image->values, count, each);
  }
  if (storage->integer != 0 && !storage->text) {
    widen(image->values, count, storage->integer > 0);
  }
  return rescale(path, storage, image, error);
}

/* Put the lowest `count` bytes of a number at `at`, the lowest first. */
static void put_bytes(unsigned char *at, uint32_t number, int count) {
  for (int i = 0; i < count; ++i) {
    at[i] = (unsigned char)(number >> 8 * i);
  }
}

/* Write what precedes the compressed voxels: the header of a gzip stream [RFC 1952], and `head` as
 * a block that is not compressed [RFC 1951, 3.2.4]; or the header of a zlib stream [RFC 1950]. */
static void write_start(int format, const void *head, size_t head_size, FILE *file) {
  static const unsigned char gzip[10] = {0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 4, 255};
  static const unsigned char zlib[2] = {0x78, 0x01};
  unsigned char block[5] = {0};
  if (format == IMAGE_GZIP) {
    (void)fwrite(gzip, 1, sizeof gzip, file);
  } else {
    (void)fwrite(zlib, 1, sizeof zlib, file);
  }
  if (head_size > 0) {
    put_bytes(block + 1, (uint32_t)head_size, 2);
    put_bytes(block + 3, ~(uint32_t)head_size, 2);
    (void)fwrite(block, 1, sizeof block, file);
    (void)fwrite(head, 1, head_size, file);
  }
}

/* Write the checksum after the compressed voxels, and for gzip the size of head and voxels. */
static void write_end(int format, const void *head, size_t head_size, const void *values,
                      size_t size, FILE *file) {
  unsigned char end[8];
  if (format == IMAGE_GZIP) {
    put_bytes(end, libdeflate_crc32(libdeflate_crc32(0, head, head_size), values, size), 4);
    put_bytes(end + 4, (uint32_t)(head_size + size), 4);
    (void)fwrite(end, 1, 8, file);
    return;
  }
  uint32_t sum = libdeflate_adler32(1, values, size);
  if (head_size > 0) {
    sum = libdeflate_adler32(libdeflate_adler32(1, head, head_size), values, size);
  }
  for (size_t i = 0; i < 4; ++i) { /* the highest byte first */
    put_bytes(end + i, sum >> (24 - 8 * i), 1);
  }
  (void)fwrite(end, 1, 4, file);
}

supine_status supine_image_pack(int format, const void *head, size_t head_size,
                                const supine_image *image, const void *values, FILE *file) {
  enum { LEVEL = 1 }; /* the fastest: it packs a CT as well as level 6 of zlib */
  const size_t size = supine_image_bytes(image);
  struct libdeflate_compressor *packer = libdeflate_alloc_compressor(LEVEL);
  if (packer == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  const size_t room = libdeflate_deflate_compress_bound(packer, size);
  void *packed = malloc(room);
  if (packed == NULL) {
    libdeflate_free_compressor(packer);
    return SUPINE_ERROR_MEMORY;
  }
  const size_t used = libdeflate_deflate_compress(packer, values, size, packed, room);
  write_start(format, head, head_size, file);
  (void)fwrite(packed, 1, used, file);
  write_end(format, head, head_size, values, size, file);
  free(packed);
  libdeflate_free_compressor(packer);
  return SUPINE_OK;
}
