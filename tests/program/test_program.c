/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the program: results, exit codes, messages, and refused input. */
#include "tests/helpers/program_helpers.h"

#include <ftw.h>

static void write_file(const char *name, const void *bytes, size_t size) {
  FILE *file = fopen(in_folder(name), "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(bytes, 1, size, file), size);
  assert_int_equal(fclose(file), 0);
}

/* Copy the beginning of a file in the test's folder to bytes [size]; return the number of bytes
 * copied. */
static size_t take_file(const char *name, char *bytes, size_t size) {
  size_t length = 0;
  char *text = test_read(in_folder(name), &length);
  length = length < size ? length : size;
  memcpy(bytes, text, length);
  free(text);
  return length;
}

static int setup(void **state) {
  if (folder_make(state) != 0) {
    return -1;
  }
  return run("phantom -o lungs.ply --vertices 500") != 0 ||
         run("precompute lungs.ply -o lungs.safetensors --band 3 --modes harmonics") != 0;
}

TEST(test_help_every_command_prints_usage) {
  static const char *const commands[] = {"phantom", "precompute", "info",    "deform",
                                         "compare", "render",     "breathe", "export",
                                         "solve",   "pv",         "fit",     "validate"};
  EXPECT(0, "precompute", "--help");
  EXPECT(0, "supine precompute --help-all", "precompute --help");
  EXPECT(0, "--held-out N", "precompute --help-all");
  EXPECT(0, "supine ", "--version");
  EXPECT(1, "Commands:", "%s", "");
  for (size_t i = 0; i < sizeof commands / sizeof *commands; ++i) {
    EXPECT(0, "Usage: supine", "%s --help", commands[i]);
    EXPECT(0, "Usage: supine", "help %s", commands[i]);
  }
  EXPECT(1, "did you mean 'deform'", "defrom");
  EXPECT(1, "'supine --help' lists the commands", "xyzzy");
  EXPECT(1, "did you mean '--posture'", "deform lungs.safetensors --postrue prone -o a.ply");
  EXPECT(1, "needs a value", "deform lungs.safetensors -o");
}

TEST(test_deform_all_spellings_of_prone_same_file) {
  static const char *const ways[] = {"--posture prone",    "--posture HFP",
                                     "--posture ffp",      "--gravity 0,-1,0",
                                     "--gravity 0,-7.5,0", "--posture upright-90"};
  static char first[1 << 20];
  static char other[1 << 20];
  EXPECT(0, "from the scan, 3153.66 mL (-2846.34 mL)", "deform lungs.safetensors %s -o way.stl",
         ways[0]);
  const size_t length = take_file("way.stl", first, sizeof first);
  for (size_t i = 1; i < sizeof ways / sizeof *ways; ++i) {
    EXPECT(0, "from the scan, 3153.66 mL (-2846.34 mL)", "deform lungs.safetensors %s -o way.stl",
           ways[i]);
    assert_int_equal(take_file("way.stl", other, sizeof other), length);
    size_t differing = 0;
    /* Compare the corners of each facet, not its normal. */
    for (size_t at = 84; at + 50 <= length; at += 50) {
      for (size_t k = 3; k < 12; ++k) {
        float p;
        float q;
        memcpy(&p, first + at + 4 * k, sizeof p);
        memcpy(&q, other + at + 4 * k, sizeof q);
        differing += fabs((double)p - (double)q) > 1e-3 ? 1 : 0;
      }
    }
    assert_int_equal(differing, 0);
  }
}

TEST(test_deform_volume_reached) {
  EXPECT(0, "-300.00 mL", "deform lungs.safetensors --posture left --volume scan-300 -o a.ply");
  EXPECT(0, "-300.00 mL", "deform lungs.safetensors --posture left:scan-300 -o a.ply");
  EXPECT(1, "two volumes are given, by left:scan-300 and by full",
         "deform lungs.safetensors --posture left:scan-300 --volume full -o a.ply");
  EXPECT(1, "every posture names its own volume",
         "compare lungs.safetensors --postures supine:full,prone:rest --volume rest");
  EXPECT(0, "the breath ends at", "compare lungs.safetensors --postures supine --breath 3500mL");
  EXPECT(1, "supine:rest+500", "deform lungs.safetensors --posture supine+500 -o a.ply");
  EXPECT(0, "gravity 0.7071,0,0.7071", "deform lungs.safetensors --posture left+45 -o a.ply");
  EXPECT(0, ", 2900.00 mL", "deform lungs.safetensors --posture left --volume 2.9L -o a.ply");
  EXPECT(1, "the posture is missing", "deform lungs.safetensors --posture rest -o b.ply");
  EXPECT(1, "a breath starts at rest", "breathe lungs.safetensors --posture left:rest -o b.vtp");
  EXPECT(0, "prone:rest+500  1626 (1411 to 1881, assumed)",
         "compare lungs.safetensors --postures supine:full,prone:rest+500");
  EXPECT(0, "pixels", "render lungs.safetensors --posture supine:full,prone:rest+500 -o a.png");
  /* A closed part has a volume in each state: the embedded surface of the lungs has theirs. */
  EXPECT(0, "504 vertices", "embed lungs.safetensors lungs.ply -o a.safetensors");
  EXPECT(0, " 6000.0            2884.6\n",
         "compare a.safetensors --postures supine:full,supine:rest");
  EXPECT(0, "+350.00 mL",
         "deform lungs.safetensors --posture left --volume left=scan+100,right=scan+250 -o a.vtp");
  EXPECT(0, "+120.00 mL", "solve lungs.ply --posture supine+15 --volume scan+120 -o a.obj");
  EXPECT(1, "once: left and right",
         "deform lungs.safetensors --posture left --volume middle=rest,right=rest -o b.ply");
  EXPECT(1, "rest+500", "deform lungs.safetensors --posture left --volume 500 -o b.ply");
  EXPECT(5, "outside the 10 to 120 %",
         "deform lungs.safetensors --posture left --volume scan-5700 -o b.ply");
  EXPECT(5, "outside the 10 to 120 %",
         "deform lungs.safetensors --posture left --volume full+1300 -o b.ply");
  EXPECT(1, "name all of them",
         "deform lungs.safetensors --posture left --volume left=rest -o b.ply");
  EXPECT(1, "give rest, full or scan",
         "deform lungs.safetensors --posture left --volume resting -o b.ply");
  EXPECT(5,
         "lungs.safetensors: prone: prone at full inflation + 3000 mL: 9000 mL are 150 % "
         "of full inflation (6000 mL), outside the 10 to 120 %",
         "compare lungs.safetensors --postures prone --volume full+3000 -o b.html");
  EXPECT(5, "left: left side at 8261 mL: 8261 mL are 138 % of",
         "compare lungs.safetensors --postures left --volume rest --breath 5000mL -o b.html");
  EXPECT(0, "note: without a breath: left: left side at 7500 mL: 7500 mL are 125 % of",
         "compare lungs.safetensors --postures left --volume full+1000 -o a.html");
  EXPECT(5, "outside the 10 to 120 % that lungs hold",
         "breathe lungs.safetensors --posture prone --tidal 4900mL --fps 2 -o b.vtp");
  EXPECT(5, "outside the 10 to 120 %",
         "solve lungs.ply --posture left --volume scan-5700 -o b.ply");
  EXPECT(5, "choose a volume nearer to rest; give --allow-folds to compute",
         "solve lungs.ply --posture left --volume full+1300 -o b.ply");
  EXPECT(0, "nodes", "embed lungs.safetensors --grid 12 -o grid.safetensors");
  EXPECT(5, "left lung: the surface folds",
         "deform grid.safetensors --posture left --volume 620mL --field-out b.nrrd");
  assert_int_equal(count_files("b."), 0);
  EXPECT(0, "at most 1 % of its triangles turn over",
         "deform grid.safetensors --posture left --volume 620mL --allow-folds --field-out "
         "folded.nrrd");
  EXPECT(0, "warning: the field folds in the body around the lungs",
         "deform grid.safetensors --posture supine --volume 750mL --allow-folds "
         "--field-out a.nrrd");
  EXPECT(0, "outside the 10 to 120 %",
         "solve lungs.ply --posture left --volume full+1300 --allow-folds -o a.ply");
  EXPECT(0, "8025 mL are 134 % of",
         "breathe lungs.safetensors --posture prone --tidal 4900mL --fps 2 --allow-folds "
         "-o a.safetensors");
  EXPECT(0, "8261 mL are 138 % of",
         "compare lungs.safetensors --postures left --breath 5000mL --allow-folds");
  EXPECT(0, "outside the 10 to 120 %",
         "deform lungs.safetensors --posture left --volume scan-5500 --allow-folds -o a.ply");
}

/* The volumes at rest and at full inflation follow from the shares of full volume in resting.h and
 * from the volumes of the two synthetic lungs, 2695.0 and 3305.0 mL. */
TEST(test_deform_rest_and_full_volumes_by_posture) {
  EXPECT(0, "-3115.37 mL", "deform lungs.safetensors --posture supine -o a.ply");
  EXPECT(0, "-3115.37 mL", "deform lungs.safetensors --posture inverted --volume rest -o a.ply");
  EXPECT(0, "-2679.46 mL", "deform lungs.safetensors --posture upright -o a.ply");
  EXPECT(0, "+654.00 mL", "deform lungs.safetensors --posture upright --volume full -o a.ply");
  EXPECT(0, "-2346.34 mL", "deform lungs.safetensors --posture prone --volume rest+500 -o a.ply");
  EXPECT(0, "-2898.62 mL", "deform lungs.safetensors --posture right --volume rest-200 -o a.ply");
  EXPECT(0, "displacement below 0.002 mm from the scan, 6000.00 mL (+0.00 mL)",
         "deform lungs.safetensors --posture right --volume full -o a.ply");
  EXPECT(0, "-2438.85 mL",
         "deform lungs.safetensors --posture left --volume left=rest,right=rest+300 -o a.ply");
  EXPECT(0, "-2846.34 mL", "solve lungs.ply --posture prone -o a.ply");
  EXPECT(0, "-2746.34 mL", "solve lungs.ply --posture prone --volume rest+100 -o a.ply");
  EXPECT(0, "+654.00 mL", "solve lungs.ply --posture upright --volume full -o a.ply");
  EXPECT(1, "all lungs together", "solve lungs.ply --posture left --volume left=rest -o b.ply");
}

/* Return the largest difference of a coordinate between two PLY files that the program wrote. */
static double positions_apart(const char *first, const char *second) {
  static char text[2][1 << 20];
  const char *names[2] = {first, second};
  const char *at[2];
  size_t stride[2];
  size_t count[2];
  for (int i = 0; i < 2; ++i) {
    assert_true(take_file(names[i], text[i], sizeof text[i]) > 0);
    const char *end = strstr(text[i], "end_header\n");
    const char *element = strstr(text[i], "element vertex ");
    assert_true(end != NULL && element != NULL);
    count[i] = strtoul(element + strlen("element vertex "), NULL, 10);
    stride[i] = 0;
    for (const char *line = text[i]; (line = strstr(line, "property float")) != NULL; ++line) {
      stride[i] += sizeof(float);
    }
    at[i] = end + strlen("end_header\n");
  }
  assert_int_equal(count[0], count[1]);
  double apart = 0.0;
  for (size_t k = 0; k < count[0]; ++k) {
    float p[2][3];
    memcpy(p[0], at[0] + k * stride[0], sizeof p[0]);
    memcpy(p[1], at[1] + k * stride[1], sizeof p[1]);
    for (int axis = 0; axis < 3; ++axis) {
      apart = fmax(apart, fabs((double)p[0][axis] - (double)p[1][axis]));
    }
  }
  return apart;
}

/* A basis reproduces its scan, in the state and in the frame of the scan. */
TEST(test_precompute_scan_state_and_frame_reproduced) {
  EXPECT(0, "-2000.00 mL",
         "deform lungs.safetensors --posture supine --volume scan-2000 -o low.ply");
  EXPECT(0,
         "in the scan: supine at full inflation - 2000 mL, 4000 mL, given\n  full inflation, "
         "supine: 6000 mL",
         "precompute low.ply --scanned full-2000 --band 7 -o low.safetensors");
  EXPECT(0, "supine: 4653 mL, computed from the scan", /* 0.5 of 2695.0 mL is missing */
         "precompute lungs.ply --lung left:0.5 --modes 1 --held-out 20 -o r.safetensors");
  EXPECT(0, "from prone at rest", "deform lungs.safetensors --posture left --from prone -o a.ply");
  EXPECT(1, "--resting: 'foo' is not a posture",
         "precompute lungs.ply --resting foo=0.4 -o r.safetensors");
  EXPECT(0, "2885 mL (2442 to 3408), assumed from healthy people", "info low.safetensors");
  EXPECT(0, "low.obj", "deform low.safetensors --posture supine --volume scan -o low.obj");
  EXPECT(0, "displacement below 0.002 mm from the scan",
         "deform low.safetensors --posture supine --volume scan --from scan -o low.obj");
  EXPECT(0, "displacement below 0.002 mm from supine at full inflation",
         "deform low.safetensors --posture prone --volume full --from full -o low.obj");
  EXPECT(0, "axes of the scan: RAS, 10 mm a unit, given\n",
         "precompute low.ply --axes RAS --units cm --band 3 -o ras.safetensors");
  EXPECT(0, "ras.ply",
         "deform ras.safetensors --posture prone --volume scan --as-scanned -o ras.ply");
  char head[256] = "";
  (void)take_file("ras.ply", head, sizeof head - 1);
  assert_says(head, "SPACE=RAS cm\n");
  /* ras.ply has the left lung first, so loading keeps the order of its vertices. */
  EXPECT(0, "the file's tag", "precompute ras.ply --units cm --band 3 -o ras.safetensors");
  EXPECT(0, "again.ply",
         "deform ras.safetensors --posture left --volume scan --as-scanned -o again.ply");
  /* Tolerance in mm, for coordinates near 200 mm rounded to float32. */
  assert_true(positions_apart("ras.ply", "again.ply") < 2e-5);
  EXPECT(0, "breath",
         "breathe ras.safetensors --posture left --as-scanned --fps 0.2 -o breath.vtp");
  static char text[1 << 20];
  assert_true(take_file("breath.vtp", text, sizeof text) > 0);
  assert_says(text, "RAS");
  EXPECT(0, "frames", "breathe ras.safetensors --posture left --fps 0.2 -o breath.vtp");
  /* Without --as-scanned, breath.vtp has displacement arrays, too. */
  assert_true(take_file("breath.vtp", text, sizeof text) > 0);
  assert_says(text, "Name=\"displacement_magnitude\"");
  EXPECT(1, "is for VTP files",
         "breathe ras.safetensors --posture left --as-scanned -o b.safetensors");
  EXPECT(1, "full-2000", "precompute low.ply --scanned supine:-2000 -o b.safetensors");
  EXPECT(1, "beyond full", "precompute low.ply --scanned full+200 -o b.safetensors");
  EXPECT(1, "not the state of a scan", "precompute low.ply --scanned 4000mL -o b.safetensors");
  EXPECT(1, "not the state of a scan", "precompute low.ply --scanned scan -o b.safetensors");
  EXPECT(1, "did you mean", "precompute low.ply --scanned sopine:rest -o b.safetensors");
  EXPECT(1, "share of the full volume", "precompute low.ply --resting prone=1.2 -o b.safetensors");
  EXPECT(1, "do not hold 6100 mL", "precompute lungs.ply --resting supine=6100mL -o b.safetensors");
  EXPECT(1, "less than the tissue", "precompute low.ply --scanned full-90000 -o b.safetensors");
  EXPECT(0,
         "warning: at full inflation the lungs hold 3000 mL (an adult's 5756 to 6724 mL): the scan "
         "was probably not at full inflation",
         "precompute lungs.ply --units 0.7937005 --height 170 --band 2 -o a.safetensors");
  EXPECT(0, "volume at rest, supine: 3000 mL, given\n",
         "precompute lungs.ply --resting supine=3000mL --height 178 --sex male --band 3 "
         "-o a.safetensors");
  EXPECT(0, "3000.00 mL (-3000.00 mL)", "deform a.safetensors --posture supine -o a.ply");
  EXPECT(0, "the scan holds 4000 mL, but its state and the volume at rest say 3000 mL",
         "precompute low.ply --scanned rest --resting supine=3000mL --band 2 -o a.safetensors");
  EXPECT(0, "supine at rest, 4000 mL, given\n  full inflation, supine: 5200 mL, given\n",
         "precompute low.ply --scanned supine:rest --full 5200mL --band 3 -o a.safetensors");
  EXPECT(0, "below 0.002 mm from the scan, 4000.00",
         "deform a.safetensors --posture supine -o a.ply");
  EXPECT(0, " 5200.00 mL", "deform a.safetensors --posture prone --volume full -o a.ply");
  EXPECT(1, "does not belong to lungs of 3000 mL",
         "precompute low.ply --scanned supine:rest --full 3000mL -o b.safetensors");
  EXPECT(1, "is for a scan at rest", "precompute low.ply --full 5200mL -o b.safetensors");
  EXPECT(0, "3553 mL (3007 to 4197), assumed from height and sex",
         "precompute lungs.ply --height 178 --sex male --band 2 -o a.safetensors");
  EXPECT(1, "check the height and the state of the scan",
         "precompute lungs.ply --units 0.8 --height 178 --sex male --band 2 -o b.safetensors");
  EXPECT(0, "law of displacement: deep",
         "precompute low.ply --scanned supine:rest --band 3 -o a.safetensors");
  EXPECT(1, "deep or paper", "precompute low.ply --law shallow -o b.safetensors");
  EXPECT(1, "leave --scanned out",
         "precompute low.ply --law paper --scanned supine:rest -o b.safetensors");
  /* The scan was taken at rest, so the surface at rest equals the scan. */
  EXPECT(0, "mL", "deform a.safetensors --posture supine -o rested.ply");
  assert_true(positions_apart("low.ply", "rested.ply") < 0.005);
  EXPECT(0, "state in the scan: the reference of every posture",
         "precompute lungs.ply --law paper --band 3 -o a.safetensors");
  EXPECT(0, "+500.00 mL", "deform a.safetensors --posture prone -o a.ply");
  assert_int_equal(count_files("b."), 0);
}

TEST(test_orientation_bad_values_refused) {
  EXPECT(1, "did you mean 'prone'", "deform lungs.safetensors --posture pron -o c.ply");
  EXPECT(1, "not all 0", "deform lungs.safetensors --gravity 0,0,0 -o c.ply");
  EXPECT(1, "three finite numbers", "deform lungs.safetensors --gravity 0,nan,0 -o c.ply");
  EXPECT(1, "three finite numbers", "deform lungs.safetensors --gravity 0,1 -o c.ply");
  EXPECT(1, "not both", "deform lungs.safetensors --posture supine --gravity 0,1,0 -o c.ply");
  EXPECT(1, "the posture is missing", "deform lungs.safetensors -o c.ply");
  assert_int_equal(count_files("c."), 0);
  EXPECT(0, "gravity 0,0.6,0.8", "deform lungs.safetensors --gravity 0,3,4 -o d.ply");
}

TEST(test_output_impossible_refused) {
  EXPECT(4, "nowhere/out", "deform lungs.safetensors --posture prone -o nowhere/out.ply");
  EXPECT(4, "nowhere/out", "precompute lungs.ply -o nowhere/out.safetensors");
  EXPECT(4, "/dev/full", "precompute lungs.ply -o /dev/full");
  EXPECT(4, "nowhere/lungs", "phantom -o nowhere/lungs.ply");
  EXPECT(4, "", "info lungs.safetensors > /dev/full");
  EXPECT(1, "must end in", "deform lungs.safetensors --posture prone -o out.xyz");
}

TEST(test_basis_damaged_or_foreign_refused) {
  static char bytes[1 << 20];
  const size_t size = take_file("lungs.safetensors", bytes, sizeof bytes);
  assert_true(size < sizeof bytes);
  write_file("bad.safetensors", bytes, size - 1);
  EXPECT(2, "bad.safetensors", "info bad.safetensors");
  write_file("bad.safetensors", bytes, 100);
  EXPECT(2, "bad.safetensors", "deform bad.safetensors --posture prone -o e.ply");
  bytes[size - 1000] ^= 0x10;
  write_file("bad.safetensors", bytes, size);
  EXPECT(2, "bad.safetensors", "deform bad.safetensors --posture prone -o e.ply");
  EXPECT(2, "lungs.ply", "deform lungs.ply --posture prone -o e.ply");
  EXPECT(2, "missing.safetensors", "deform missing.safetensors --posture prone -o e.ply");
  test_write(in_folder("empty"), "");
  EXPECT(2, "empty", "info empty");
  assert_int_equal(count_files("e."), 0);
}

TEST(test_mesh_bad_input_named_and_no_file_left) {
  static char bytes[1 << 20];
  EXPECT(2, "missing.ply", "precompute missing.ply -o f.safetensors");
  test_write(in_folder("empty.ply"), "");
  EXPECT(2, "empty.ply", "precompute empty.ply -o f.safetensors");
  const size_t size = take_file("lungs.ply", bytes, sizeof bytes);
  write_file("cut.ply", bytes, size / 2);
  EXPECT(2, "cut.ply", "precompute cut.ply -o f.safetensors");
  test_write(in_folder("nan.obj"),
             "v 0 0 0\nv 1 0 0\nv 0 nan 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  EXPECT(2, "nan.obj", "precompute nan.obj -o f.safetensors");
  test_write(in_folder("inf.obj"),
             "v 0 0 0\nv 1 0 0\nv 0 inf 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  EXPECT(2, "inf.obj", "precompute inf.obj -o f.safetensors");
  test_write(in_folder("points.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
  EXPECT(2, "points.obj", "solve points.obj --posture prone -o f.ply");
  EXPECT(2, ".", "precompute . -o f.safetensors");
  EXPECT(1, "name one or more mesh files", "precompute -o f.safetensors");
  EXPECT(1, "--units takes", "precompute lungs.ply --units parsec -o f.safetensors");
  EXPECT(1, "--axes takes", "precompute lungs.ply --axes XYZ -o f.safetensors");
  assert_int_equal(count_files("f."), 0);
}

TEST(test_mesh_open_surface_refused) {
  test_write(in_folder("open.obj"),
             "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 200\nf 1 3 2\nf 1 2 4\nf 2 3 4\n");
  EXPECT(2, "3 boundary", "precompute open.obj -o g.safetensors --band 2");
  EXPECT(2, "close its holes", "solve open.obj --posture prone -o g.ply");
  assert_int_equal(count_files("g."), 0);
}

TEST(test_mesh_wrong_units_refused) {
  test_write(in_folder("metres.obj"),
             "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.25\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  EXPECT(2, "--units m", "solve metres.obj --posture prone -o h.ply");
  EXPECT(0, "largest displacement", "solve metres.obj --units m --posture prone -o h.ply");
  assert_null(strstr(printed, "units"));
}

TEST(test_mesh_inward_lung_flipped_and_reported) {
  test_write(in_folder("in.obj"),
             "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 250\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 1 3 4\n");
  EXPECT(0, "note: in.obj: the triangles of the left lung faced inwards: reversed",
         "solve in.obj --posture prone -o h.ply");
  EXPECT(2, "surfaces 1 and 2 have the same bounding box: give each lung once",
         "solve in.obj in.obj --posture prone -o h.ply");
  EXPECT(2, "runs through the right lung", "solve in.obj --midline 49 --posture prone -o h.ply");
}

TEST(test_solve_unit_force_writes_column) {
  static char text[1 << 20];
  EXPECT(0, "", "solve lungs.ply --unit-force 17 -o column.csv");
  text[take_file("column.csv", text, sizeof text - 1)] = '\0';
  assert_says(text, "vertex,x_mm,y_mm,z_mm,response\n0,");
  EXPECT(1, "counted from 0", "solve lungs.ply --unit-force 99999 -o column.csv");
}

static int sweep_failures;
static int sweep_files;

static int sweep(const char *path, const struct stat *status, int type, struct FTW *walk) {
  (void)status;
  (void)walk;
  if (type == FTW_F) {
    ++sweep_files;
    (void)setenv("SWEPT", path, 1);
    const int code = run("precompute \"$SWEPT\" --band 1 -o swept.safetensors");
    if ((code != 0 && code != 2) || (code != 0) != (count_files("swept") == 0)) {
      printf("%s: exit code %d: %s\n", path, code, printed);
      ++sweep_failures;
    }
    (void)unlink(in_folder("swept.safetensors"));
  }
  return 0;
}

TEST_FULL(test_precompute_hostile_files_never_crash) {
  char defects[] = SUPINE_TEST_DATA "/defects";
  char *real = realpath(defects, NULL);
  if (real == NULL) {
    printf("skipped: %s is missing\n", defects);
    skip();
    return;
  }
  assert_int_equal(nftw(real, sweep, 8, FTW_PHYS), 0);
  free(real);
  printf("%d files\n", sweep_files);
  assert_true(sweep_files > 20);
  assert_int_equal(sweep_failures, 0);
}

TEST_GROUP(setup, folder_remove)
