/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the checks and repairs of surfaces of lungs after loading. */
#include "mesh/repair.h"
#include "precompute/lungs/gate.h"
#include "precompute/lungs/phantom.h"
#include "tests/helpers/findings.h"
#include "tests/helpers/test.h"

static supine_mesh phantom(void) {
  supine_mesh mesh = {0};
  assert_int_equal(supine_lungs_phantom_create(3000, 6000.0, &mesh, NULL), SUPINE_OK);
  return mesh;
}

/* Return the left lung of the phantom, whose vertices and triangles come first. */
static supine_mesh left_lung(void) {
  supine_mesh mesh = phantom();
  mesh.triangle_count /= 2;
  mesh.vertex_count /= 2;
  return mesh;
}

static void turn_triangle(supine_mesh *mesh, size_t t) {
  const uint32_t second = mesh->triangles[3 * t + 1];
  mesh->triangles[3 * t + 1] = mesh->triangles[3 * t + 2];
  mesh->triangles[3 * t + 2] = second;
}

/* Convert the coordinates as if a file in these axes had been read as LPS. */
static void misread(supine_mesh *mesh, supine_axes axes) {
  double matrix[3][3];
  supine_mesh_axes_matrix(axes, matrix);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    double *p = mesh->vertices + 3 * i;
    const double q[3] = {p[0], p[1], p[2]};
    for (int k = 0; k < 3; ++k) {
      p[k] = matrix[0][k] * q[0] + matrix[1][k] * q[1] + matrix[2][k] * q[2];
    }
  }
  for (size_t t = 0; supine_mesh_axes_mirrored(axes) && t < mesh->triangle_count; ++t) {
    turn_triangle(mesh, t);
  }
}

/* Append vertices and triangles. If `of_new`, the indices in `corner` count from the first appended
 * vertex. */
static void append(supine_mesh *mesh, size_t vertices, const double *at, size_t triangles,
                   const uint32_t *corner, bool of_new) {
  const size_t n = mesh->vertex_count;
  const size_t m = mesh->triangle_count;
  mesh->vertices = realloc(mesh->vertices, 3 * (n + vertices) * sizeof *mesh->vertices);
  mesh->triangles = realloc(mesh->triangles, 3 * (m + triangles) * sizeof *mesh->triangles);
  assert_true(mesh->vertices != NULL && mesh->triangles != NULL);
  if (vertices > 0) {
    memcpy(mesh->vertices + 3 * n, at, 3 * vertices * sizeof *at);
  }
  for (size_t i = 0; i < 3 * triangles; ++i) {
    mesh->triangles[3 * m + i] = corner[i] + (of_new ? (uint32_t)n : 0);
  }
  mesh->vertex_count += vertices;
  mesh->triangle_count += triangles;
}

static const uint32_t tetrahedron[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

typedef struct outcome {
  supine_status status;
  supine_lungs lungs;
  supine_findings findings;
  supine_error error;
  bool hold;
} outcome;

static outcome pass(supine_mesh *mesh, const supine_lungs_source *given) {
  outcome out = {.error = {SUPINE_OK, ""}};
  const supine_lungs_source plain = {.name = "lungs.ply", .axes = SUPINE_AXES_LPS};
  out.status = supine_lungs_gate(mesh, 1, given == NULL ? &plain : given, &out.lungs, &out.hold,
                                 &out.findings, &out.error);
  return out;
}

TEST(test_axes_letters_all_48_round_trip) {
  for (int code = 1; code < SUPINE_AXES_COUNT; ++code) {
    char letters[4];
    supine_axes axes = SUPINE_AXES_AUTO;
    supine_mesh_axes_letters((supine_axes)code, letters);
    assert_true(supine_mesh_axes_parse(letters, &axes));
    assert_int_equal(axes, code);
  }
  supine_axes axes = SUPINE_AXES_AUTO;
  char letters[4];
  supine_mesh_axes_letters(SUPINE_AXES_RAS, letters);
  assert_string_equal(letters, "RAS");
  assert_false(supine_mesh_axes_parse("LLS", &axes));
  assert_false(supine_mesh_axes_parse("lps", &axes));
  assert_false(supine_mesh_axes_parse("LPSX", &axes));
}

TEST(test_axes_apply_letters_permute_and_flip) {
  supine_axes axes = SUPINE_AXES_AUTO;
  double p[3] = {1.5, -2.25, 4.0};
  assert_true(supine_mesh_axes_parse("SRA", &axes)); /* axes point to superior, right, anterior */
  supine_mesh_axes_apply(axes, 2.0, p);
  assert_true(p[0] == 4.5 && p[1] == -8.0 && p[2] == 3.0);
}

TEST(test_gate_clean_lungs_no_message) {
  supine_mesh mesh = phantom();
  const supine_mesh before = phantom();
  outcome out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_OK);
  assert_string_equal(findings_text(&out.findings), "");
  assert_true(out.hold);
  assert_int_equal(out.lungs.lung_count, 2);
  assert_memory_equal(mesh.vertices, before.vertices, 3 * mesh.vertex_count * sizeof(double));
  assert_memory_equal(mesh.triangles, before.triangles, 3 * mesh.triangle_count * 4);
  supine_lungs_free(&out.lungs);
  supine_mesh_free(&mesh);
  supine_mesh_free((supine_mesh *)&before);
}

/* Turned by 40 degrees about the left-right axis, lungs look mirrored. */
TEST(test_lungs_gate_pitched_scan_warned_of) {
  supine_mesh mesh = phantom();
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    double *p = mesh.vertices + 3 * i;
    const double y = p[1];
    p[1] = 0.766 * y - 0.643 * p[2];
    p[2] = 0.643 * y + 0.766 * p[2];
  }
  outcome out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_OK);
  assert_says(findings_text(&out.findings), "pitched by more than 25 degrees");
  supine_lungs_free(&out.lungs);
  supine_mesh_free(&mesh);
}

/* Return whether one of the findings advises to give these axes. */
static bool advises_axes(const supine_findings *findings, const char *value) {
  for (size_t i = 0; i < findings->count; ++i) {
    if (findings->list[i].remedies[0].kind == SUPINE_REMEDY_GIVE &&
        strcmp(findings->list[i].remedies[0].argument, "axes") == 0 &&
        strcmp(findings->list[i].remedies[0].value, value) == 0) {
      return true;
    }
  }
  return false;
}

/* A mesh in any of the 47 axis conventions other than LPS is read as if it were in LPS. The warning
 * proposes the true axes. */
TEST(test_gate_any_wrong_axes_proposes_correct_ones) {
  for (int code = 2; code < SUPINE_AXES_COUNT; ++code) {
    supine_mesh mesh = phantom();
    char wanted[4];
    misread(&mesh, (supine_axes)code);
    supine_mesh_axes_letters((supine_axes)code, wanted);
    outcome out = pass(&mesh, NULL);
    assert_int_equal(out.status, SUPINE_OK);
    assert_true(advises_axes(&out.findings, wanted));
    assert_says(findings_text(&out.findings), "the axes are doubtful");
    assert_false(out.hold);
    supine_lungs_free(&out.lungs);
    supine_mesh_free(&mesh);
  }
}

/* --axes RAS is given for a file whose axes are LPS. The warning proposes LPS. */
TEST(test_gate_wrong_axes_option_proposes_correct_one) {
  supine_mesh mesh = phantom();
  const supine_lungs_source ras = {.name = "x", .axes = SUPINE_AXES_RAS};
  misread(&mesh, SUPINE_AXES_RAS); /* as if --axes RAS were given for an LPS file */
  outcome out = pass(&mesh, &ras);
  assert_true(advises_axes(&out.findings, "LPS"));
  supine_lungs_free(&out.lungs);
  supine_mesh_free(&mesh);
}

TEST(test_gate_single_lung_side_found_by_shape) {
  static const char *const said[] = {"taken for the left lung by its shape",
                                     "taken for the right lung by its shape"};
  for (int right = 0; right < 2; ++right) {
    supine_mesh mesh = left_lung();
    for (size_t i = 0; right != 0 && i < mesh.vertex_count; ++i) {
      mesh.vertices[3 * i] *= -1.0; /* a mirrored left lung has the shape of a right lung */
    }
    for (size_t i = 0; i < mesh.vertex_count; ++i) {
      /* Put the lung on the wrong side of the body, which must not matter. */
      mesh.vertices[3 * i] += right != 0 ? 900.0 : -900.0;
    }
    outcome out = pass(&mesh, NULL);
    assert_int_equal(out.status, SUPINE_OK);
    assert_says(findings_text(&out.findings), said[right]);
    assert_int_equal(out.lungs.side[0], right != 0 ? -1 : 1);
    assert_true(out.lungs.midline == (right != 0 ? out.lungs.maximum : out.lungs.minimum)[0]);
    supine_lungs_free(&out.lungs);
    supine_mesh_free(&mesh);
  }
}

TEST(test_gate_specks_dropped_and_reported) {
  enum { SPECKS = 10 };
  static const double at[4][3] = {
      {300, -300, 300}, {301, -300, 300}, {300, -299, 300}, {300, -300, 301}};
  supine_mesh mesh = phantom();
  const size_t vertices = mesh.vertex_count;
  outcome clean = pass(&mesh, NULL);
  for (size_t speck = 0; speck < SPECKS; ++speck) {
    double corners[4][3];
    for (size_t i = 0; i < 12; ++i) {
      corners[i / 3][i % 3] = at[i / 3][i % 3] + 10.0 * (double)speck;
    }
    append(&mesh, 4, corners[0], 4, tetrahedron[0], true);
  }
  outcome out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_OK);
  assert_says(findings_text(&out.findings),
              "dropped 10 small components, each below 1 % of the volume; 2 components remain");
  assert_int_equal(out.lungs.mesh.vertex_count, vertices);
  assert_memory_equal(out.lungs.mesh.vertices, clean.lungs.mesh.vertices,
                      3 * vertices * sizeof(double));
  assert_true(out.lungs.topology.closed);
  supine_lungs_free(&clean.lungs);
  supine_lungs_free(&out.lungs);
  supine_mesh_free(&mesh);
}

TEST(test_gate_duplicate_loose_reversed_triangles_repaired) {
  supine_mesh mesh = phantom();
  const supine_mesh before = phantom();
  uint32_t again[5][3];
  memcpy(again, mesh.triangles + 3 * 100, sizeof again);
  append(&mesh, 0, NULL, 5, again[0], false);
  const uint32_t across[1][3] = {{mesh.triangles[0], mesh.triangles[900], mesh.triangles[1800]}};
  append(&mesh, 0, NULL, 1, across[0], false);
  for (size_t t = 40; t < 47; ++t) {
    turn_triangle(&mesh, t);
  }
  outcome out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_OK);
  assert_says(findings_text(&out.findings), "dropped 5 duplicate triangles");
  assert_says(findings_text(&out.findings), "dropped 1 loose triangle\n");
  assert_says(findings_text(&out.findings), "reversed 7 triangles");
  assert_int_equal(out.lungs.mesh.triangle_count, before.triangle_count);
  assert_memory_equal(out.lungs.mesh.triangles, before.triangles, 12 * before.triangle_count);
  assert_true(out.lungs.topology.closed);
  supine_lungs_free(&out.lungs);
  supine_mesh_free(&mesh);
  supine_mesh_free((supine_mesh *)&before);
}

/* The surface has 8 pieces of at least 85 mL. Lungs have only 5 lobes. */
TEST(test_gate_many_pieces_reported) {
  supine_mesh mesh = phantom();
  for (int side = 0; side < 6; ++side) {
    double at[4][3];
    for (int k = 0; k < 12; ++k) { /* corners of a tetrahedron of 85 mL */
      at[k / 3][k % 3] = (k % 3 == 2      ? 100.0 * (side / 2) - 100.0
                          : side % 2 == 0 ? -300.0
                                          : 300.0) +
                         (k / 3 == k % 3 + 1 ? 80.0 : 0.0);
    }
    append(&mesh, 4, at[0], 4, tetrahedron[0], true);
  }
  outcome out = pass(&mesh, NULL);
  assert_says(findings_text(&out.findings),
              "warning: lungs.ply: 8 components; remove those that are not lung");
  supine_lungs_free(&out.lungs);
  supine_mesh_free(&mesh);
}

/* Two lungs that share one vertex are separated at this vertex. */
TEST(test_gate_touching_lungs_separated) {
  supine_mesh mesh = phantom();
  const size_t half = mesh.vertex_count / 2;
  /* The innermost vertex has the least x in the left lung and the largest x in the right lung. */
  size_t inner[2] = {0, half};
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    const double x = mesh.vertices[3 * i];
    inner[0] = i < half && x < mesh.vertices[3 * inner[0]] ? i : inner[0];
    inner[1] = i >= half && x > mesh.vertices[3 * inner[1]] ? i : inner[1];
  }
  for (size_t i = 0; i < 3 * mesh.triangle_count; ++i) {
    mesh.triangles[i] = mesh.triangles[i] == inner[1] ? (uint32_t)inner[0] : mesh.triangles[i];
  }
  outcome out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_OK);
  assert_says(findings_text(&out.findings), "surfaces touched at 1 point: separated there");
  assert_int_equal(out.lungs.lung_count, 2);
  assert_true(out.lungs.topology.closed);
  supine_lungs_free(&out.lungs);
  supine_mesh_free(&mesh);
}

/* An ellipsoid with a waist, as wide as two lungs, is refused unless the midline is given. */
TEST(test_gate_both_lungs_in_one_piece_refused) {
  supine_mesh mesh = left_lung();
  double low[3];
  double high[3];
  supine_mesh_box(&mesh, low, high);
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    double *p = mesh.vertices + 3 * i;
    double u[3];
    for (int k = 0; k < 3; ++k) {
      u[k] = 2.0 * (p[k] - low[k]) / (high[k] - low[k]) - 1.0;
    }
    const double length = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    const double waist = 0.35 + 0.65 * fmin(1.0, 2.0 * fabs(u[0] / length));
    p[0] = 150.0 * u[0] / length;
    p[1] = 75.0 * waist * u[1] / length;
    p[2] = 90.0 * waist * u[2] / length;
  }
  outcome out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_ERROR_MESH);
  assert_says(out.error.message, "both lungs in one piece");
  const double midline = -151.0;
  const supine_lungs_source one = {.name = "one.ply", .axes = SUPINE_AXES_LPS, .midline = &midline};
  out = pass(&mesh, &one);
  assert_int_equal(out.status, SUPINE_OK);
  supine_lungs_free(&out.lungs);
  supine_mesh_free(&mesh);
}

TEST(test_gate_impossible_size_refused_unless_units_given) {
  supine_mesh mesh = phantom();
  for (size_t i = 0; i < 3 * mesh.vertex_count; ++i) {
    mesh.vertices[i] *= 1e-3;
  }
  outcome out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_ERROR_MESH);
  assert_says(out.error.message, "impossible");
  assert_string_equal(out.error.remedies[0].argument, "units");
  assert_string_equal(out.error.remedies[0].value, "m");
  assert_int_equal(out.error.remedies[1].kind, SUPINE_REMEDY_NONE);
  const supine_lungs_source given = {
      .name = "small.ply", .axes = SUPINE_AXES_LPS, .units_given = true};
  out = pass(&mesh, &given);
  assert_int_equal(out.status, SUPINE_OK);
  assert_says(findings_text(&out.findings), "warning: small.ply: the lungs are 0.");
  supine_lungs_free(&out.lungs);
  for (size_t i = 0; i < 3 * mesh.vertex_count; ++i) {
    mesh.vertices[i] *= 50; /* a mouse's lungs */
  }
  out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_ERROR_MESH);
  assert_string_equal(out.error.remedies[1].value, "mm");
  supine_mesh_free(&mesh);
}

/* A surface whose only defect is a hole is left unchanged. */
TEST(test_repair_open_surface_unchanged) {
  supine_mesh mesh = phantom();
  supine_mesh_repair_report report;
  mesh.triangle_count -= 3; /* makes a hole */
  const size_t count = mesh.triangle_count;
  assert_int_equal(supine_mesh_repair(&mesh, &report), SUPINE_OK);
  assert_int_equal(report.duplicates + report.loose + report.reversed + report.separated, 0);
  assert_int_equal(mesh.triangle_count, count);
  supine_mesh_free(&mesh);
}

static void scale(supine_mesh *mesh, double x, double y, double z) {
  const double factor[3] = {x, y, z};
  for (size_t i = 0; i < 3 * mesh->vertex_count; ++i) {
    mesh->vertices[i] *= factor[i % 3];
  }
}

TEST(test_gate_impossible_volume_or_height_refused_unless_units_given) {
  static const struct {
    double ml, ratio; /* volume; height divided by width */
    const char *said;
    bool refused;
  } cases[] = {{6000.0, 1.81, "as high as wide", true},   {6000.0, 1.79, "", false},
               {6000.0, 0.54, "as high as wide", true},   {6000.0, 0.56, "", false},
               {12001.0, 1.0, "and hold 12001 mL", true}, {11999.0, 1.0, "", false},
               {99.8, 1.0, "and hold 100 mL", true},      {101.0, 1.0, "", false}};
  for (size_t k = 0; k < 2 * sizeof cases / sizeof *cases; ++k) {
    const supine_lungs_source given = {
        .name = "x.ply", .axes = SUPINE_AXES_LPS, .units_given = k % 2 == 1};
    supine_mesh mesh = phantom();
    double low[3];
    double high[3];
    (void)supine_mesh_box(&mesh, low, high);
    const double x = 250.0 / (high[0] - low[0]);
    const double z = 250.0 * cases[k / 2].ratio / (high[2] - low[2]);
    scale(&mesh, x, cases[k / 2].ml / (1e-3 * supine_mesh_volume(&mesh) * x * z), z);
    outcome out = pass(&mesh, &given);
    const bool refused = cases[k / 2].refused && k % 2 == 0;
    assert_int_equal(out.status, refused ? SUPINE_ERROR_MESH : SUPINE_OK);
    assert_says(refused ? out.error.message : findings_text(&out.findings), cases[k / 2].said);
    if (cases[k / 2].said[0] == '\0') {
      assert_null(strstr(findings_text(&out.findings), "as high as wide"));
      assert_null(strstr(findings_text(&out.findings), "the lungs hold"));
    }
    supine_lungs_free(&out.lungs);
    supine_mesh_free(&mesh);
  }
}

/* A given unit turns refusals into warnings, except beyond the volume that a basis may have. */
TEST(test_gate_volume_beyond_basis_refused_even_with_units_given) {
  static const double ml[] = {9.9e7, 1.01e8};
  for (size_t k = 0; k < 2; ++k) {
    const supine_lungs_source given = {
        .name = "x.ply", .axes = SUPINE_AXES_LPS, .units_given = true};
    supine_mesh mesh = phantom();
    const double by = cbrt(ml[k] / (1e-3 * supine_mesh_volume(&mesh)));
    scale(&mesh, by, by, by);
    outcome out = pass(&mesh, &given);
    assert_int_equal(out.status, k == 0 ? SUPINE_OK : SUPINE_ERROR_MESH);
    if (k == 1) {
      assert_says(out.error.message, "more than the 1e+08 mL that a basis may have");
    }
    supine_lungs_free(&out.lungs);
    supine_mesh_free(&mesh);
  }
}

TEST(test_gate_lifted_vertex_refused_at_its_place) {
  static const char *const ends[6] = {"right", "left", "front", "back", "feet", "head"};
  for (size_t end = 0; end < 6; ++end) {
    char place[64];
    supine_mesh mesh = phantom();
    double *p = mesh.vertices + 3 * (mesh.vertex_count / 3);
    p[end / 2] += end % 2 == 0 ? -500.0 : 500.0;
    (void)snprintf(place, sizeof place, "up to %.0f,%.0f,%.0f mm", p[0], p[1], p[2]);
    outcome out = pass(&mesh, NULL);
    assert_int_equal(out.status, SUPINE_ERROR_MESH);
    assert_says(out.error.message, ends[end]);
    assert_says(out.error.message, place);
    supine_mesh_free(&mesh);
  }
}

TEST(test_gate_lungs_that_overlap_and_inner_surface_refused) {
  supine_mesh mesh = phantom();
  const size_t half = mesh.vertex_count / 2;
  double gap[2] = {INFINITY, -INFINITY};
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    gap[0] = i < half ? fmin(gap[0], mesh.vertices[3 * i]) : gap[0];
    gap[1] = i < half ? gap[1] : fmax(gap[1], mesh.vertices[3 * i]);
  }
  for (size_t i = half; i < mesh.vertex_count; ++i) {
    mesh.vertices[3 * i] += gap[0] - gap[1] + 30.0;
  }
  outcome out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_ERROR_MESH);
  assert_says(out.error.message, "mm into another one, at ");
  supine_mesh_free(&mesh);
  mesh = phantom();
  double at[4][3]; /* a tetrahedron of 85 mL around the left lung's centre */
  double centre[3] = {0.0, 0.0, 0.0};
  for (size_t i = 0; i < 3 * half; ++i) {
    centre[i % 3] += mesh.vertices[i] / (double)half;
  }
  for (int k = 0; k < 12; ++k) {
    at[k / 3][k % 3] = centre[k % 3] - 20.0 + (k / 3 == k % 3 + 1 ? 80.0 : 0.0);
  }
  append(&mesh, 4, at[0], 4, tetrahedron[0], true);
  out = pass(&mesh, NULL);
  assert_int_equal(out.status, SUPINE_ERROR_MESH);
  assert_says(out.error.message, "mm into another one, at ");
  supine_mesh_free(&mesh);
}

/* Vertices below the cut are moved up to it, and the vertices around the apex far up. */
TEST(test_gate_flat_end_and_thin_tip_warned_of) {
  for (int tube = 0; tube < 2; ++tube) {
    supine_mesh mesh = phantom();
    double low[3];
    double high[3];
    (void)supine_mesh_box(&mesh, low, high);
    for (size_t i = 0; i < mesh.vertex_count; ++i) {
      double *z = &mesh.vertices[3 * i + 2];
      *z = tube == 0 ? fmax(*z, low[2] + 60.0) : *z > high[2] - 1.5 ? *z + 30.0 : *z;
    }
    outcome out = pass(&mesh, NULL);
    assert_int_equal(out.status, SUPINE_OK);
    assert_says(findings_text(&out.findings),
                tube == 0 ? "towards the feet are" : "towards the head are");
    assert_says(findings_text(&out.findings), tube == 0 ? "cut off flat there" : "trachea");
    supine_lungs_free(&out.lungs);
    supine_mesh_free(&mesh);
  }
}
