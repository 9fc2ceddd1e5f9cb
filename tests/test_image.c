/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test images in NRRD, NIfTI and MetaImage: round trips and invalid files. */
#include <sys/stat.h>

#include "folder.h"
#include "mesh/image/image.h"

#include "sh_helpers.h"

/* Make an image of 5 x 4 x 3 voxels in a random orientation. */
static supine_image made(supine_image_voxel voxel, uint64_t seed) {
  supine_image image = {
      .size = {5, 4, 3}, .origin = {-101.5, 33.25, 7.0}, .voxel = voxel, .channels = 1};
  double turn[3][3];
  random_rotation(&seed, turn);
  for (int a = 0; a < 3; ++a) {
    for (int k = 0; k < 3; ++k) {
      image.step[a][k] = (0.7 + 0.4 * a) * turn[a][k];
    }
  }
  image.values = calloc(60, supine_image_voxel_size(voxel));
  for (size_t i = 0; i < 60; ++i) {
    supine_image_put(&image, i, 1, &(double){rint(120.0 * random_signed(&seed))});
  }
  return image;
}

static void check_same(const supine_image *a, const supine_image *b, double tolerance) {
  assert_memory_equal(a->size, b->size, sizeof a->size);
  assert_int_equal(a->voxel, b->voxel);
  for (int i = 0; i < 3; ++i) {
    assert_close(a->origin[i], b->origin[i], tolerance);
    for (int k = 0; k < 3; ++k) {
      assert_close(a->step[i][k], b->step[i][k], tolerance);
    }
  }
  for (size_t i = 0; i < 60; ++i) {
    assert_close(supine_image_get(a, i), supine_image_get(b, i), 0.0);
  }
}

TEST(test_image_write_then_read_same) {
  static const char *const names[] = {"a.nrrd", "a.nii", "a.nii.gz", "A.NRRD"};
  for (int voxel = 0; voxel < SUPINE_VOXEL_COUNT; ++voxel) {
    for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
      supine_image image = made((supine_image_voxel)voxel, 41 + 7 * (uint64_t)voxel);
      supine_image back = {0};
      supine_error error;
      if (supine_image_write(in_folder(names[i]), &image, "a note", &error) != SUPINE_OK ||
          supine_image_read(in_folder(names[i]), &back, &error) != SUPINE_OK) {
        fail_msg("%s", error.message);
      }
      /* NIfTI-1 stores positions as float32; here they are below 256 mm. */
      check_same(&image, &back, 0x1p-23 * 256.0);
      supine_image_free(&image);
      supine_image_free(&back);
    }
  }
}

static void write_bytes(const char *path, const void *bytes, size_t size) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(bytes, 1, size, file), size);
  assert_int_equal(fclose(file), 0);
}

static size_t read_bytes(const char *path, unsigned char *bytes, size_t room) {
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  const size_t size = fread(bytes, 1, room, file);
  assert_int_equal(fclose(file), 0);
  return size;
}

TEST(test_nrrd_in_ras_converted_to_lps) {
  static const char text[] = "NRRD0004\ntype: uchar\ndimension: 3\n"
                             "space: right-anterior-superior\nsizes: 2 1 2\n"
                             "space directions: (2,0.5,0) (0,3,0) (0,0,4)\n"
                             "space origin: (10,20,30)\nencoding: ascii\n\n1 2 3 4\n";
  supine_image image = {0};
  write_bytes(in_folder("ras.nrrd"), text, sizeof text - 1);
  assert_int_equal(supine_image_read(in_folder("ras.nrrd"), &image, NULL), SUPINE_OK);
  static const double origin[] = {-10, -20, 30};
  static const double first[] = {-2, -0.5, 0};
  for (int k = 0; k < 3; ++k) {
    assert_close(image.origin[k], origin[k], 0.0);
    assert_close(image.step[0][k], first[k], 0.0);
  }
  assert_close(supine_image_get(&image, 2), 3.0, 0.0);
  double voxel[3];
  supine_image_locate(&image, (const double[]){-12.0, -23.5, 34.0}, voxel);
  assert_close(voxel[0], 1.0, 1e-12);
  assert_close(voxel[1], 1.0, 1e-12);
  assert_close(voxel[2], 1.0, 1e-12);
  supine_image_free(&image);
}

/* A big-endian NIfTI file is read, with the slope and the intercept of its values. */
TEST(test_nifti_big_endian_with_slope_read) {
  unsigned char bytes[352 + 120];
  supine_image image = made(SUPINE_VOXEL_I16, 5);
  supine_image back = {0};
  assert_int_equal(supine_image_write(in_folder("b.nii"), &image, NULL, NULL), SUPINE_OK);
  assert_int_equal(read_bytes(in_folder("b.nii"), bytes, sizeof bytes), sizeof bytes);
  const float slope[2] = {0.5F, -3.0F};
  memcpy(bytes + 112, slope, sizeof slope);
  static const struct {
    size_t begin, end, size;
  } fields[] = {{0, 4, 4},     {40, 56, 2},   {70, 74, 2},  {76, 120, 4},
                {252, 256, 2}, {280, 328, 4}, {352, 472, 2}};
  for (size_t f = 0; f < sizeof fields / sizeof *fields; ++f) {
    for (size_t at = fields[f].begin; at < fields[f].end; at += fields[f].size) {
      for (size_t i = 0; i < fields[f].size / 2; ++i) {
        const unsigned char swap = bytes[at + i];
        bytes[at + i] = bytes[at + fields[f].size - 1 - i];
        bytes[at + fields[f].size - 1 - i] = swap;
      }
    }
  }
  write_bytes(in_folder("big.nii"), bytes, sizeof bytes);
  supine_error error;
  if (supine_image_read(in_folder("big.nii"), &back, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  assert_int_equal(back.voxel, SUPINE_VOXEL_F32);
  for (size_t i = 0; i < 60; ++i) {
    assert_close(supine_image_get(&back, i), 0.5 * supine_image_get(&image, i) - 3.0, 0.0);
  }
  supine_image_free(&image);
  supine_image_free(&back);
}

static void check_refused(const char *name, supine_status expected, const char *said) {
  supine_image image = {0};
  supine_error error;
  assert_int_equal(supine_image_read(in_folder(name), &image, &error), expected);
  assert_says(error.message, said);
  assert_null(image.values);
}

TEST(test_nrrd_bad_files_refused) {
  static const struct {
    const char *header, *said;
  } bad[] = {
      {"dimension: 3\nspace: LPS\nsizes: 10000 10000 10000\nspace directions: (1,0,0) (0,1,0) "
       "(0,0,1)\nspace origin: (0,0,0)\n",
       "do not fit in"},
      {"dimension: 4\nspace: LPS\nsizes: 1 1 1 4\nspace directions: none (1,0,0) (0,1,0) "
       "(0,0,1)\nspace origin: (0,0,0)\n",
       "dimension 4"},
      {"dimension: 3\nsizes: 1 2 2\nspacings: 1 1 1\n", "directions"},
      {"dimension: 3\nspace: LAS\nsizes: 1 2 2\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace "
       "origin: (0,0,0)\n",
       "neither"},
      {"dimension: 3\nspace: LPS\nsizes: 1 2 2\nspace directions: (1,0,0) (1,0,0) (0,0,1)\nspace "
       "origin: (0,0,0)\n",
       "linearly dependent"},
      {"dimension: 3\nspace: LPS\nsizes: 1 2 2\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace "
       "origin: (0,0,0)\ndata file: /etc/passwd\n",
       "another file"},
      {"dimension: 3\nspace: LPS\nsizes: 1 2 200\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace "
       "origin: (0,0,0)\n",
       "bad.nrrd"},
      {"sizes: 1 2 2\n", "bad.nrrd"},
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    char text[512];
    const int length = snprintf(text, sizeof text, "NRRD0004\ntype: uchar\n%sencoding: raw\n\nabcd",
                                bad[i].header);
    write_bytes(in_folder("bad.nrrd"), text, (size_t)length);
    check_refused("bad.nrrd", SUPINE_ERROR_FORMAT, bad[i].said);
  }
}

TEST(test_nifti_bad_files_refused) {
  unsigned char bytes[472];
  unsigned char changed[472];
  supine_image image = made(SUPINE_VOXEL_I16, 5);
  assert_int_equal(supine_image_write(in_folder("c.nii"), &image, NULL, NULL), SUPINE_OK);
  assert_int_equal(read_bytes(in_folder("c.nii"), bytes, sizeof bytes), sizeof bytes);
  supine_image_free(&image);
  static const struct {
    size_t at;
    int16_t value[8];
    size_t count;
    const char *said;
  } bad[] = {{40, {3, 32767, 32767, 32767, 1}, 5, "do not fit in"},
             {40, {4, 5, 4, 1, 3}, 5, "ndim is 4"},
             {254, {0}, 1, "orientation"},
             {70, {32}, 1, "COMPLEX"},
             {280,
              {0, 0, 0, 0, 0, 0, 0, 0},
              8,
              "linearly dependent"}}; /* the first row of the matrix is 0 */
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    memcpy(changed, bytes, sizeof bytes);
    memcpy(changed + bad[i].at, bad[i].value, bad[i].count * sizeof(int16_t));
    write_bytes(in_folder("bad.nii"), changed, sizeof changed);
    check_refused("bad.nii", SUPINE_ERROR_FORMAT, bad[i].said);
  }
  for (size_t size = 0; size < sizeof bytes; size += 23) {
    write_bytes(in_folder("short.nii"), bytes, size);
    check_refused("short.nii", SUPINE_ERROR_FORMAT, "short.nii");
  }
}

/* A wrong checksum is refused, although all voxels can be decompressed. */
TEST(test_image_gzip_checksum_wrong_refused) {
  static const char *const names[] = {"c.nrrd", "c.nii.gz", "c.mha"};
  for (size_t i = 0; i < 3; ++i) {
    unsigned char bytes[4096];
    supine_image image = made(SUPINE_VOXEL_F64, 5);
    assert_int_equal(supine_image_write(in_folder(names[i]), &image, NULL, NULL), SUPINE_OK);
    const size_t size = read_bytes(in_folder(names[i]), bytes, sizeof bytes);
    /* zlib data end with the checksum. gzip data end with the checksum and the size, each of 4
     * bytes. */
    bytes[size - (i == 2 ? 1 : 5)] ^= 0x55;
    write_bytes(in_folder(names[i]), bytes, size);
    check_refused(names[i], SUPINE_ERROR_FORMAT, names[i]);
    supine_image_free(&image);
  }
}

TEST(test_image_truncated_gzip_refused) {
  static const char *const names[] = {"d.nrrd", "d.nii.gz", "d.mha"};
  for (size_t i = 0; i < 3; ++i) {
    unsigned char bytes[4096];
    supine_image image = made(SUPINE_VOXEL_F64, 5);
    assert_int_equal(supine_image_write(in_folder(names[i]), &image, NULL, NULL), SUPINE_OK);
    const size_t size = read_bytes(in_folder(names[i]), bytes, sizeof bytes);
    write_bytes(in_folder(names[i]), bytes, size - 60);
    check_refused(names[i], SUPINE_ERROR_FORMAT, names[i]);
    supine_image_free(&image);
  }
}

TEST(test_image_bad_names_and_folders_refused) {
  supine_image image = made(SUPINE_VOXEL_U8, 5);
  supine_error error;
  assert_true(supine_image_supports("x.NII.GZ") && supine_image_supports("x.nrrd"));
  assert_true(supine_image_is_named("x.nii") && supine_image_is_named("x.MHA"));
  assert_false(supine_image_is_named("x.ply") || supine_image_supports("x.mhd"));
  assert_false(supine_image_supports("x.gz") || supine_image_supports(".nrrd"));
  check_refused("image.mhd", SUPINE_ERROR_FORMAT, ".nrrd");
  check_refused("absent.nrrd", SUPINE_ERROR_READ, "absent");
  assert_int_equal(mkdir(in_folder("folder.nrrd"), 0700), 0);
  check_refused("folder.nrrd", SUPINE_ERROR_READ, "not a regular file");
  assert_int_equal(supine_image_write(in_folder("x.mhd"), &image, NULL, &error),
                   SUPINE_ERROR_ARGUMENT);
  image.channels = 2;
  assert_int_equal(supine_image_write(in_folder("x.nii"), &image, NULL, &error),
                   SUPINE_ERROR_ARGUMENT);
  image.channels = 1;
  assert_int_equal(supine_image_write("/nowhere/x.nii", &image, NULL, &error), SUPINE_ERROR_WRITE);
  assert_int_equal(supine_image_write("/nowhere/x.nrrd", &image, NULL, &error), SUPINE_ERROR_WRITE);
  assert_int_equal(supine_image_write("/dev/full", &image, NULL, &error), SUPINE_ERROR_ARGUMENT);
  supine_image_free(&image);
}

TEST(test_image_put_16_bit_rounds_and_clips) {
  supine_image image = made(SUPINE_VOXEL_I16, 5);
  supine_image_put(&image, 3, 1, &(double){7.6});
  supine_image_put(&image, 4, 1, &(double){4e4});
  supine_image_put(&image, 5, 1, &(double){-4e4});
  assert_close(supine_image_get(&image, 3), 8.0, 0.0);
  assert_close(supine_image_get(&image, 4), 32767.0, 0.0);
  assert_close(supine_image_get(&image, 5), -32768.0, 0.0);
  supine_image_free(&image);
}

TEST_GROUP(folder_make, folder_remove)
