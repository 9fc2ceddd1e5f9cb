/* SPDX-License-Identifier: MIT */
/* Check that a gzip stream is complete, because readers of voxels stop when they have enough. */
#include <fcntl.h>
#include <unistd.h>

#include <zlib.h>

#include "mesh/io/image_formats.h"

supine_status supine_image_check_gzip(const char *path, long offset, supine_error *error) {
  enum { PIECE = 1 << 16 };
  unsigned char piece[PIECE];
  const int descriptor = open(path, O_RDONLY | O_CLOEXEC);
  if (descriptor < 0 || lseek(descriptor, offset, SEEK_SET) < 0) {
    if (descriptor >= 0) {
      (void)close(descriptor);
    }
    return supine_error_set(error, SUPINE_ERROR_READ, "%s: cannot read: check its permissions",
                            path);
  }
  gzFile file = gzdopen(descriptor, "rb");
  if (file == NULL) {
    (void)close(descriptor);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
  }
  int count;
  do {
    count = gzread(file, piece, PIECE);
  } while (count > 0);
  const int closed = gzclose(file); /* Z_BUF_ERROR if the stream ends early */
  return count == 0 && closed == Z_OK
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%s: damaged: its compressed data or their checksum are wrong; "
                                "fetch or write the file again",
                                path);
}
