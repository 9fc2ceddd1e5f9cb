/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test images in NRRD, NIfTI and MetaImage: round trips and invalid files. */
#include <sys/inotify.h>
#include <sys/stat.h>

#include "mesh/image/image.h"
#include "tests/helpers/folder.h"

#include "tests/helpers/sh_helpers.h"

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
      {"dimension: 4\nspace: LPS\nsizes: 2 1 1 2\nspace directions: none (1,0,0) (0,1,0) "
       "(0,0,1)\nspace origin: (0,0,0)\n",
       "dimension is 4"},
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

/* What the field's tools read: no origin, hexadecimal digits, a last line of blanks, a segmentation
 * of one layer, and units. */
TEST(test_nrrd_unusual_files_read) {
  static const struct {
    const char *text;
    double step; /* of the last axis */
  } good[] = {
      {"NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nsizes: 2 1 2\nspace directions: (1,0,0) "
       "(0,1,0) (0,0,2)\nencoding: hex\n\n04 05\n0607\n",
       2.0},
      {"NRRD0004\ntype: uchar\ndimension: 4\nspace: LPS\nsizes: 1 2 1 2\nkinds: list domain domain "
       "domain\nspace directions: none (1,0,0) (0,1,0) (0,0,2)\nspace origin: (0,0,0)\nencoding: "
       "raw\n \t\n\4\5\6\7",
       2.0},
      {"NRRD0004\ntype: uchar\ndimension: 4\nspace: LPS\nsizes: 2 1 2 1\nspace directions: (1,0,0) "
       "(0,1,0) (0,0,2) none\nencoding: ascii\n\n4 5 6 7",
       2.0},
      {"NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nspace units: \"cm\" \"cm\" \"cm\"\n"
       "sizes: 2 1 2\nspace directions: (.1,0,0) (0,.1,0) (0,0,.2)\nencoding: ascii\n\n4 5 6 7",
       2.0}};
  for (size_t i = 0; i < sizeof good / sizeof *good; ++i) {
    supine_image image = {0};
    supine_error error;
    write_bytes(in_folder("good.nrrd"), good[i].text, strlen(good[i].text));
    if (supine_image_read(in_folder("good.nrrd"), &image, &error) != SUPINE_OK) {
      fail_msg("%s: %s", good[i].text, error.message);
    }
    assert_int_equal(image.size[2], 2);
    assert_close(image.step[2][2], good[i].step, 1e-15);
    assert_close(image.origin[0], 0.0, 0.0);
    for (size_t v = 0; v < 4; ++v) {
      assert_close(supine_image_get(&image, v), 4.0 + (double)v, 0.0);
    }
    supine_image_free(&image);
  }
}

/* What a file should state and does not, or what contradicts it, is not assumed. */
TEST(test_image_unstated_spacing_and_spare_voxels_refused) {
#define MHA "ObjectType = Image\nNDims = 3\nDimSize = 2 1 2\nElementType = MET_UCHAR\n"
#define NRRD                                                                                       \
  "NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nsizes: 2 1 2\nspace directions: (1,0,0) "      \
  "(0,1,0) "                                                                                       \
  "(0,0,2)\n"
  static const struct {
    const char *name, *text, *said;
  } bad[] = {
      {"a.mha", MHA "ElementDataFile = LOCAL\nabcd", "states no voxel spacing"},
      {"a.mha", MHA "Spacing = 1 1 2\nElementDataFile = LOCAL\nabcd", "name it ElementSpacing"},
      {"a.mha", MHA "elementspacing = 1 1 2\nElementDataFile = LOCAL\nabcd",
       "name it ElementSpacing"},
      {"a.mha", MHA "ElementSpacing = 1 1 2\nElementSpacing = 1 1 1\nElementDataFile = LOCAL\nabcd",
       "one thing twice"},
      {"a.mha", MHA "ElementSpacing = 1 1 0\nElementDataFile = LOCAL\nabcd", "not above 0"},
      {"a.mha", MHA "ElementSpacing = 1 1 2\nDistanceUnits = ell\nElementDataFile = LOCAL\nabcd",
       "DistanceUnits"},
      {"a.mha", MHA "ElementSpacing = 1 1 2\nElementDataFile = LOCAL\nabcdef", "more voxels"},
      {"a.nrrd", NRRD "encoding: raw\n\nabcdef", "more voxels"},
      {"a.nrrd", NRRD "encoding: ascii\n\n1 2 3 4 5 6", "more voxels"},
      {"a.nrrd", NRRD "encoding: raw\nspace units: \"mm\" \"mm\" \"cm\"\n\nabcd", "space units"},
      {"a.nrrd", NRRD "encoding: raw\nspace units: \"ell\"\n\nabcd", "space units"}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    write_bytes(in_folder(bad[i].name), bad[i].text, strlen(bad[i].text));
    check_refused(bad[i].name, SUPINE_ERROR_FORMAT, bad[i].said);
  }
  static const char cm[] =
      MHA "Offset = 1 2 3\nElementSpacing = .1 .1 .2\nDistanceUnits = cm\nElementDataFile = "
          "LOCAL\nabcd\n";
  supine_image image = {0};
  write_bytes(in_folder("cm.mha"), cm, sizeof cm - 1); /* one byte more is padding */
  assert_int_equal(supine_image_read(in_folder("cm.mha"), &image, NULL), SUPINE_OK);
  assert_close(image.step[2][2], 2.0, 0.0);
  assert_close(image.origin[1], 20.0, 0.0);
  supine_image_free(&image);
}

/* A qform has no lengths of its own: pixdim must state them. */
TEST(test_nifti_qform_without_pixdim_refused) {
  static const float wrong[] = {0.0F, -1.5F, NAN};
  unsigned char bytes[472];
  supine_image image = made(SUPINE_VOXEL_I16, 5);
  supine_image read = {0};
  assert_int_equal(supine_image_write(in_folder("q.nii"), &image, NULL, NULL), SUPINE_OK);
  assert_int_equal(read_bytes(in_folder("q.nii"), bytes, sizeof bytes), sizeof bytes);
  memcpy(bytes + 252, (const int16_t[]){1, 0}, 2 * sizeof(int16_t)); /* qform, no sform */
  write_bytes(in_folder("q.nii"), bytes, sizeof bytes);
  assert_int_equal(supine_image_read(in_folder("q.nii"), &read, NULL), SUPINE_OK);
  assert_close(read.step[1][1], -1.1, 1e-6); /* the quaternion 0: no turn, from RAS */
  supine_image_free(&read);
  for (size_t i = 0; i < 3; ++i) {
    unsigned char changed[472];
    memcpy(changed, bytes, sizeof bytes);
    memcpy(changed + 84, &wrong[i], sizeof wrong[i]);
    write_bytes(in_folder("w.nii"), changed, sizeof changed);
    check_refused("w.nii", SUPINE_ERROR_FORMAT, "pixdim[2]");
  }
  supine_image_free(&image);
}

#define NRRD_FRAME                                                                                 \
  "space: LPS\nsizes: 2 2 1\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n"

/* What a header names is not opened: inotify reports no access, and a pipe does not make the reader
 * wait. */
TEST(test_nrrd_data_file_not_opened) {
  static const char *const lines[] = {
      "data file: %s/data.raw\n",      "datafile: data.raw\n",
      "Data File: ../%s/data.raw\n",   "data file: pipe.raw\n",
      "data file: %s/pipe.raw\n",      "data file: LIST\ndata.raw\n",
      "data file: LIST 2\npipe.raw\n", "data file: pipe%%d.raw 0 1 1\n",
      "data file:\tpipe.raw\n"};
  static const char *const ends[] = {"", "\n", "\nabcd"};
  char events[4096];
  write_bytes(in_folder("data.raw"), "abcd", 4);
  assert_int_equal(mkfifo(in_folder("pipe.raw"), 0600), 0);
  assert_int_equal(mkfifo(in_folder("pipe0.raw"), 0600), 0);
  const int watch = inotify_init1(IN_NONBLOCK);
  assert_true(watch >= 0);
  assert_true(inotify_add_watch(watch, in_folder("data.raw"), IN_OPEN) >= 0);
  (void)alarm(60); /* ends a reader that waits for the pipe */
  for (size_t i = 0; i < 3 * (sizeof lines / sizeof *lines); ++i) {
    char line[256];
    char text[1024];
    (void)snprintf(line, sizeof line, lines[i / 3], folder); /* NOLINT(*-nonliteral) */
    const int length = snprintf(
        text, sizeof text, "NRRD0004\ntype: uchar\ndimension: 3\n" NRRD_FRAME "encoding: raw\n%s%s",
        line, ends[i % 3]);
    write_bytes(in_folder("bad.nrrd"), text, (size_t)length);
    check_refused("bad.nrrd", SUPINE_ERROR_FORMAT, "in another file");
    if (read(watch, events, sizeof events) >= 0) {
      fail_msg("opened for %s", line);
    }
  }
  (void)alarm(0);
  assert_int_equal(close(watch), 0);
}

/* Each name of a type, an encoding, a space and an order of bytes, each way to write a field, and
 * each field that is not used. */
TEST(test_nrrd_header_variants_read) {
  static const struct {
    const char *header;
    supine_image_voxel voxel;
  } good[] = {
      {"type: signed char\n", SUPINE_VOXEL_I8},
      {"type: int8\n", SUPINE_VOXEL_I8},
      {"type: int8_t\n", SUPINE_VOXEL_I8},
      {"type: unsigned char\n", SUPINE_VOXEL_U8},
      {"type: uint8_t\n", SUPINE_VOXEL_U8},
      {"type: short\n", SUPINE_VOXEL_I16},
      {"type: signed short int\n", SUPINE_VOXEL_I16},
      {"type: int16_t\n", SUPINE_VOXEL_I16},
      {"type: ushort\n", SUPINE_VOXEL_U16},
      {"type: unsigned short int\n", SUPINE_VOXEL_U16},
      {"type: int\n", SUPINE_VOXEL_I32},
      {"type: signed int\n", SUPINE_VOXEL_I32},
      {"type: uint32\n", SUPINE_VOXEL_U32},
      {"type: unsigned int\n", SUPINE_VOXEL_U32},
      {"type: long long\n", SUPINE_VOXEL_F64},
      {"type: signed long long int\n", SUPINE_VOXEL_F64},
      {"type: uint64_t\n", SUPINE_VOXEL_F64},
      {"type: ulonglong\n", SUPINE_VOXEL_F64},
      {"type: float\n", SUPINE_VOXEL_F32},
      {"TYPE:  Double \n", SUPINE_VOXEL_F64},
      {"type: uchar\r\n", SUPINE_VOXEL_U8},
      {"# a comment: with a colon\n#\ntype: uchar\n", SUPINE_VOXEL_U8},
      {"type: uchar\nSegment0_Name:=left lung: upper lobe\nurn:x:=data file: y\n:=\n"
       "left: lobe:=upper: one\n \t# an indented comment\n",
       SUPINE_VOXEL_U8},
      {"type: uchar\ncontent:\nunits: \"mm\" \"mm\" \"mm\"\nkinds: domain domain domain\n"
       "labels: \"\" \"\" \"\"\nspace units: \"mm\" \"mm\" \"mm\"\n"
       "measurement frame: (1,0,0) (0,1,0) (0,0,1)\ncenterings: cell cell cell\nmin: 0\n"
       "old max: 9\nsample units: HU\nthicknesses: 1 1 1\nblock size: 1\nnumber: 4\n"
       "axismins: 0 0 0\nbyte skip: 0\nlineskip: 0\nspacings: nan nan nan\n",
       SUPINE_VOXEL_U8},
      {"type: uchar\nSpace Origin: (0,0,0)\nspace directions: ( 1 , 0 ,0)(0,1e0,0) (0,0,+1.0)\n"
       "sizes:  2 2\t1 \nspace: left-posterior-superior\n",
       SUPINE_VOXEL_U8}};
  static const char *const encodings[] = {"ascii", "text", "TXT"};
  for (size_t i = 0; i < sizeof good / sizeof *good; ++i) {
    char text[1500];
    supine_image image = {0};
    const bool framed = strstr(good[i].header, "sizes:") != NULL;
    supine_error error;
    const int length =
        snprintf(text, sizeof text,
                 "NRRD000%zu\ndimension: 3\n"
                 "%s%sencoding: %s\n\n"
                 "4 5\n 6\t7",
                 1 + i % 6, framed ? "" : NRRD_FRAME, good[i].header, encodings[i % 3]);
    write_bytes(in_folder("good.nrrd"), text, (size_t)length);
    if (supine_image_read(in_folder("good.nrrd"), &image, &error) != SUPINE_OK) {
      fail_msg("%s: %s", good[i].header, error.message);
    }
    assert_int_equal(image.voxel, good[i].voxel);
    assert_close(image.step[1][1], 1.0, 0.0);
    for (size_t v = 0; v < 4; ++v) {
      assert_close(supine_image_get(&image, v), 4.0 + (double)v, 0.0);
    }
    supine_image_free(&image);
  }
}

TEST(test_nrrd_malformed_headers_refused) {
  static const char sound[] =
      "NRRD0004\ntype: uchar\ndimension: 3\n" NRRD_FRAME "encoding: raw\n\nabcd";
  static const struct {
    const char *from, *to, *said; /* text replaced in the sound header, and its replacement */
  } bad[] = {{"NRRD0004", "NRRD0000", "first line"},
             {"NRRD0004", "NRRD0007", "first line"},
             {"NRRD0004", "NRRD0004 and more text", "first line"},
             {"raw", "hex", "truncated or damaged"}, /* "abcd" has two bytes */
             {"raw", "base64", "encoding"},
             {"raw", "bzip2", "encoding"},
             {"encoding: raw\n", "", "encoding"},
             {"raw\n", "raw\nbyte skip: -1\n", "skips"},
             {"raw\n", "raw\nlineskip: 2\n", "skips"},
             {"uchar", "block", "its type"},
             {"uchar", "char", "its type"},
             {"type: uchar\n", "", "its type"},
             {"uchar", "short", "endian"},
             {"uchar", "short\nendian: middle", "endian"},
             {"uchar", "uchar\nwidth: 3", "line 3"},
             {"uchar", "uchar\nwords", "line 3"},
             {"uchar", "uchar\ntype: short", "line 3"},
             {"sizes: 2 2 1", "sizes: 2 2 1\nsizes: 2 2 2", "line 6"},
             {"sizes: 2 2 1", "sizes: 2 2", "sizes"},
             {"sizes: 2 2 1", "sizes: 2 2 1 1", "sizes"},
             {"sizes: 2 2 1", "sizes: 2 2 0", "sizes"},
             {"sizes: 2 2 1", "sizes: 2 2 -1", "sizes"},
             {"sizes: 2 2 1", "sizes: 2 2 1.5", "sizes"},
             {"sizes: 2 2 1", "sizes: 2 2 nan", "sizes"},
             {"sizes: 2 2 1", "sizes: 2 2 1e30", "sizes"},
             {"sizes: 2 2 1\n", "", "sizes"},
             {"origin: (0,0,0)", "origin: (0,0)", "vectors"},
             {"origin: (0,0,0)", "origin: (0,0,0", "vectors"},
             {"origin: (0,0,0)", "origin:", "vectors"},
             {"origin: (0,0,0)", "origin: (0,0,nan)", "linearly"},
             {"(0,0,1)", "", "vectors"},
             {"(0,0,1)", "none", "vectors"},
             {"(0,0,1)", "(0,0,1) (0,0,1)", "vectors"},
             {"(0,0,1)", "(0;0;1)", "vectors"},
             {"dimension: 3\n", "", "dimension"},
             {"dimension: 3", "dimension: x", "dimension"}};
  supine_image image = {0};
  write_bytes(in_folder("sound.nrrd"), sound, sizeof sound - 1);
  assert_int_equal(supine_image_read(in_folder("sound.nrrd"), &image, NULL), SUPINE_OK);
  supine_image_free(&image);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    char text[1024];
    const char *at = strstr(sound, bad[i].from);
    assert_non_null(at);
    const int length = snprintf(text, sizeof text, "%.*s%s%s", (int)(at - sound), sound, bad[i].to,
                                at + strlen(bad[i].from));
    write_bytes(in_folder("bad.nrrd"), text, (size_t)length);
    check_refused("bad.nrrd", SUPINE_ERROR_FORMAT, bad[i].said);
  }
  static const char head[] = "NRRD0004\n" NRRD_FRAME "type: uchar\ndimension: 3\nencoding: raw\n";
  for (size_t size = 0; size < sizeof head; ++size) { /* no empty line */
    write_bytes(in_folder("cut.nrrd"), head, size);
    check_refused("cut.nrrd", SUPINE_ERROR_FORMAT, "cut.nrrd");
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
    size_t at; /* offset of dim (40), datatype (70), vox_offset (108), sform_code (254) or srow_x */
    int16_t value[8];
    size_t count;
    const char *said;
  } bad[] = {{40, {3, 32767, 32767, 32767, 1}, 5, "do not fit in"},
             {40, {4, 5, 4, 1, 3}, 5, "ndim is 4"},
             {254, {0}, 1, "orientation"},
             {70, {32}, 1, "COMPLEX"},
             {108, {0, 0}, 2, "its vox_offset is 0"},
             {108, {0, 0x43AE}, 2, "its vox_offset is 348"},
             {108, {0, 0x7FC0}, 2, "vox_offset"},
             {280, {0}, 8, "linearly dependent"}};
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

TEST(test_nifti_plain_named_gz_read) {
  unsigned char bytes[472];
  supine_image image = made(SUPINE_VOXEL_I16, 5);
  supine_image read = {0};
  assert_int_equal(supine_image_write(in_folder("plain.nii"), &image, NULL, NULL), SUPINE_OK);
  assert_int_equal(read_bytes(in_folder("plain.nii"), bytes, sizeof bytes), sizeof bytes);
  write_bytes(in_folder("plain.nii.gz"), bytes, sizeof bytes);
  assert_int_equal(supine_image_read(in_folder("plain.nii.gz"), &read, NULL), SUPINE_OK);
  assert_memory_equal(read.values, image.values,
                      image.size[0] * image.size[1] * image.size[2] * sizeof(int16_t));
  supine_image_free(&image);
  supine_image_free(&read);
}

TEST(test_mha_long_header_and_element_size_read) {
  char text[8192] = "ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\n";
  size_t length = strlen(text);
  for (int i = 0; i < 200; ++i) {
    length += (size_t)snprintf(text + length, sizeof text - length, "Note%d = x\n", i);
  }
  length += (size_t)snprintf(text + length, sizeof text - length,
                             "ElementSize = 2 3 4\nElementType = MET_UCHAR\n"
                             "ElementDataFile = LOCAL\n");
  supine_image read = {0};
  write_bytes(in_folder("long.mha"), text, length + 8); /* zeros follow the text */
  assert_int_equal(supine_image_read(in_folder("long.mha"), &read, NULL), SUPINE_OK);
  assert_true(read.step[1][1] == 3.0);
  assert_true(read.step[2][2] == 4.0);
  supine_image_free(&read);
}

/* The header of a pair of files, named like a single file, is not read as voxels. */
TEST(test_nifti_voxels_in_other_file_refused) {
  unsigned char bytes[472];
  supine_image image = made(SUPINE_VOXEL_I16, 5);
  assert_int_equal(supine_image_write(in_folder("pair.nii"), &image, NULL, NULL), SUPINE_OK);
  assert_int_equal(read_bytes(in_folder("pair.nii"), bytes, sizeof bytes), sizeof bytes);
  memcpy(bytes + 344, "ni1", 4);
  write_bytes(in_folder("pair.nii"), bytes, sizeof bytes);
  assert_int_equal(mkfifo(in_folder("pair.img"), 0600), 0);
  check_refused("pair.nii", SUPINE_ERROR_FORMAT, "in another file");
  supine_image_free(&image);
}

/* Pipes, which opening would wait for, are refused. */
TEST(test_image_pipe_refused_without_waiting) {
  static const char *const names[] = {"p.nrrd", "p.nii", "p.nii.gz", "p.mha"};
  (void)alarm(60);
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    assert_int_equal(mkfifo(in_folder(names[i]), 0600), 0);
    check_refused(names[i], SUPINE_ERROR_READ, "not a regular file");
  }
  (void)alarm(0);
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
