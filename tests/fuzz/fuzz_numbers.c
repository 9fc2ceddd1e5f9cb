/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fuzz the numbers of a basis file and of arguments. An input is a list of changes, each of three
 * bytes: which quantity, which of its numbers, and the new value. The size of the input modulo 3
 * chooses a basis of scalars, of clusters, or of fields over volume. The file gets the correct
 * checksum. What is not refused must give finite results, and an argument that is not finite must
 * be refused. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/breath.h>
#include <supine/locate.h>
#include <supine/runtime.h>

#include "runtime/safetensors/safetensors_file.h"

#include "fuzz.h"

enum { N = 12, M = 16, LUNGS = 2, NUMBERS = 64, NORMAL_TERMS = 4 };

/* The basis of an input. */
typedef enum variant { SCALAR, CLUSTERS, SIMULATED, VARIANTS } variant;

/* Which variants have a quantity. */
enum { ALL = 7, GRAVITY = 3, CLUSTERED = 2, OVER_VOLUME = 4, STORED = 5 };

/* All numbers that an input can change. */
typedef struct numbers {
  double vertices[3 * N], direction[3 * N], coefficients[N], modes[1];
  double linear[3 * LUNGS], quadratic[3 * LUNGS], cubic[LUNGS], resting[9 * LUNGS];
  double normal_weights[LUNGS * 3 * NORMAL_TERMS], lungs_box[6], lungs_squares[3 * LUNGS];
  double bend[3], scan_gravity[3], scan_volume[LUNGS], upright_gain, midline;
  double expected, expected_from, spread;
  double gravity[3], volume, lung_volume[LUNGS], weight, gains[3 * LUNGS];
  double breath[4], time, position[3], noise;
  double cluster_vectors[18 * LUNGS], simulated_modes[2], range[2 * LUNGS], limits[18 * LUNGS];
  double shares[18 * LUNGS], full[9 * LUNGS], total[2];
} numbers;

/* Whether a quantity is a tensor, metadata or an argument. */
typedef enum kind { FLOATS, DOUBLES, TEXT, ARGUMENT } kind;

#define OF(member) offsetof(numbers, member), sizeof((numbers *)0)->member / sizeof(double)
static const struct {
  const char *name;
  kind kind;
  size_t begin, count, rank, shape[SUPINE_TENSOR_RANK_MAX];
  unsigned variants;
} quantities[] = {
    {"vertices", FLOATS, OF(vertices), 2, {N, 3}, ALL},
    {"direction", FLOATS, OF(direction), 2, {N, 3}, STORED},
    {"coefficients", FLOATS, OF(coefficients), 2, {N, 1}, STORED},
    {"modes", DOUBLES, OF(modes), 3, {1, 1, 1}, GRAVITY},
    {"volume_linear", DOUBLES, OF(linear), 3, {LUNGS, 3, 1}, ALL},
    {"volume_quadratic", DOUBLES, OF(quadratic), 4, {LUNGS, 3, 1, 1}, ALL},
    {"volume_cubic", DOUBLES, OF(cubic), 4, {LUNGS, 1, 1, 1}, ALL},
    {"resting_volume", DOUBLES, OF(resting), 2, {LUNGS, 9}, ALL},
    {"normal_weights", DOUBLES, OF(normal_weights), 4, {LUNGS, 1, 3, NORMAL_TERMS}, ALL},
    {"lungs_box", DOUBLES, OF(lungs_box), 2, {2, 3}, ALL},
    {"lungs_squares", DOUBLES, OF(lungs_squares), 4, {LUNGS, 3, 1, 1}, ALL},
    {"bend", TEXT, OF(bend), 0, {0}, ALL},
    {"scan_gravity", TEXT, OF(scan_gravity), 0, {0}, ALL},
    {"scan_volume_ml", TEXT, OF(scan_volume), 0, {0}, ALL},
    {"full_upright_gain", TEXT, OF(upright_gain), 0, {0}, ALL},
    {"midline_mm", TEXT, OF(midline), 0, {0}, ALL},
    {"expected_error_mm", TEXT, OF(expected), 0, {0}, ALL},
    {"expected_error_from_mm", TEXT, OF(expected_from), 0, {0}, ALL},
    {"resting_spread", TEXT, OF(spread), 0, {0}, ALL},
    {"gravity", ARGUMENT, OF(gravity), 0, {0}, ALL},
    {"volume", ARGUMENT, OF(volume), 0, {0}, ALL},
    {"volume of each lung", ARGUMENT, OF(lung_volume), 0, {0}, ALL},
    {"weight", ARGUMENT, OF(weight), 0, {0}, ALL},
    {"gains", ARGUMENT, OF(gains), 0, {0}, ALL},
    {"breath", ARGUMENT, OF(breath), 0, {0}, ALL},
    {"time", ARGUMENT, OF(time), 0, {0}, ALL},
    {"position", ARGUMENT, OF(position), 0, {0}, ALL},
    {"noise", ARGUMENT, OF(noise), 0, {0}, ALL},
    {"cluster_vectors", FLOATS, OF(cluster_vectors), 3, {LUNGS, 1, 18}, CLUSTERED},
    {"modes", DOUBLES, OF(simulated_modes), 3, {1, 1, 2}, OVER_VOLUME},
    {"simulated_range", DOUBLES, OF(range), 2, {LUNGS, 2}, OVER_VOLUME},
    {"simulated_limits", DOUBLES, OF(limits), 3, {LUNGS, 2, 9}, OVER_VOLUME},
    {"simulated_shares", DOUBLES, OF(shares), 3, {LUNGS, 9, 2}, OVER_VOLUME},
    {"full_volume", DOUBLES, OF(full), 2, {LUNGS, 9}, OVER_VOLUME},
    {"simulated_total_ml", TEXT, OF(total), 0, {0}, OVER_VOLUME},
};
static const double values[] = {
    (double)NAN,
    (double)INFINITY,
    -(double)INFINITY,
    0.0,
    -1.0,
    1.0,
    5e-324,
    1e-300,
    -1e-300,
    1e-30,
    1e-9,
    1000.,
    1e9,
    1e30,
    1e300,
};
enum {
  QUANTITIES = sizeof quantities / sizeof *quantities,
  VALUES = sizeof values / sizeof *values,
  WAYS = 3 /* set all numbers of a quantity, multiply all, or set one */
};

static uint32_t triangles[3 * M];
static uint8_t lung_of[N];
static uint32_t part[N];
static int8_t normal_bytes[3 * 2 * N];
static uint16_t cluster[N];
static int16_t scalars[2 * N];

static const double constant = 3.5449077018110318; /* times Y(0, 0) is 1 */

/* Shrink a lung of a basis of clusters by s around its centre. */
static void add_cluster(numbers *x, size_t lung, double s) {
  double *v = x->cluster_vectors + 18 * lung;
  v[0] = lung == 0 ? -150.0 * s : 150.0 * s;
  v[3] = s;
  v[7] = s;
  v[11] = s;
  v[12] = 1e-4;
}

/* Let a lung hold 0.73 to 1.33 times its volume of `ml`, with a weight of -0.5 t. */
static void add_simulated(numbers *x, size_t lung, double ml) {
  x->simulated_modes[1] = -0.5 * constant;
  for (size_t side = 0; side < 2; ++side) {
    const double sign = side == 0 ? -1.0 : 1.0;
    x->range[2 * lung + side] = ml * (pow(1.0 + 0.1 * sign, 3.0) - 1.0);
    x->limits[9 * (2 * lung + side)] = 0.2 * sign * ml * constant;
    x->total[side] = 0.5 * sign * ml;
  }
  x->shares[18 * lung + 1] = 0.25 * ml * constant;
  x->full[9 * lung] = 0.15 * ml * constant;
}

/* Two octahedra, 1333 mL each, that shrink by 20 % on each axis at gains of 1. */
static numbers sound(void) {
  static const int corners[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                    {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  const double radius = 100.0;
  const double ml = 4.0 / 3.0 * 1e-3 * radius * radius * radius;
  const double s = -0.2;
  numbers x = {.modes = {3.5449077018110318},
               .lungs_box = {-250.0, -100.0, -100.0, 250.0, 100.0, 100.0},
               .bend = {0.0, -0.45, 0.45},
               .scan_gravity = {0.0, 1.0, 0.0},
               .upright_gain = 0.1,
               .expected = 4.5,
               .expected_from = 20.0,
               .spread = 0.17,
               .gravity = {0.3, 0.8, -0.52},
               .volume = 50.0,
               .lung_volume = {20.0, 30.0},
               .weight = 1.0,
               .gains = {0.5, 0.6, 0.7, 0.8, 0.9, 1.0},
               .breath = {500.0, 12.0, 0.4, 5.0},
               .time = 1.25,
               .position = {-50.0, 3.0, 4.0},
               .noise = 2.0};
  for (size_t i = 0; i < N; ++i) {
    const size_t axis = i % 6 / 2;
    const double side = i % 2 == 0 ? radius : -radius;
    x.vertices[3 * i] = i < 6 ? 150.0 : -150.0;
    x.vertices[3 * i + axis] += side;
    x.direction[3 * i + axis] = s * side;
    x.coefficients[i] = 1.0;
    lung_of[i] = i < 6 ? 0 : 1;
    part[i] = lung_of[i];
    cluster[i] = lung_of[i];
    scalars[2 * i] = (int16_t)(1000 * i);
    normal_bytes[6 * i + 2 * axis] = side > 0.0 ? 100 : -100;
  }
  for (size_t t = 0; t < 3 * M; ++t) {
    triangles[t] = (uint32_t)(corners[t / 3 % 8][t % 3]) + (t < 3 * 8 ? 0 : 6);
  }
  for (size_t lung = 0; lung < LUNGS; ++lung) {
    for (size_t axis = 0; axis < 3; ++axis) {
      x.linear[3 * lung + axis] = ml * s;
      x.quadratic[3 * lung + axis] = ml * s * s;
      x.lungs_squares[3 * lung + axis] = 50.0;
      x.normal_weights[(3 * lung + axis) * NORMAL_TERMS] = 1e-5;
    }
    x.cubic[lung] = ml * s * s * s;
    x.resting[9 * lung] = -0.45 * ml * constant;
    add_cluster(&x, lung, s);
    add_simulated(&x, lung, ml);
  }
  return x;
}

static void change(numbers *x, const uint8_t *record) {
  const size_t q = record[0] % QUANTITIES;
  const double value = values[record[2] % VALUES];
  double *at = (double *)(void *)((char *)x + quantities[q].begin);
  const size_t chosen = record[1] / WAYS % quantities[q].count;
  for (size_t i = 0; i < quantities[q].count; ++i) {
    if (record[1] % WAYS == 1) {
      at[i] *= value;
    } else if (record[1] % WAYS == 0 || i == chosen) {
      at[i] = value;
    }
  }
}

/* Write the file with its checksum into new memory. */
static char *write_basis(const numbers *x, variant which, size_t *size) {
  static float floats[QUANTITIES][NUMBERS];
  static char texts[QUANTITIES][128];
  static const char names[] = "left part\nright part";
  supine_tensor tensors[QUANTITIES + 7] = {
      {"triangles", SUPINE_U32, 2, {M, 3}, triangles},    {"lung", SUPINE_U8, 1, {N}, lung_of},
      {"normals", SUPINE_I8, 3, {N, 3, 2}, normal_bytes}, {"part", SUPINE_U32, 1, {N}, part},
      {"names", SUPINE_U8, 1, {sizeof names - 1}, names},
  };
  supine_metadata metadata[QUANTITIES + 5] = {{"format", "supine-basis"},
                                              {"version", "4"},
                                              {"kind", which == CLUSTERS ? "vector" : "scalar"},
                                              {"lungs", "left,right"},
                                              {"scanned", "full"}};
  size_t tensor_count = 5;
  size_t metadata_count = 5;
  if (which == CLUSTERS) {
    tensors[tensor_count++] = (supine_tensor){"clusters", SUPINE_U16, 1, {N}, cluster};
    tensors[tensor_count++] = (supine_tensor){"cluster_scalars", SUPINE_I16, 2, {N, 2}, scalars};
  }
  for (size_t q = 0; q < QUANTITIES; ++q) {
    if ((quantities[q].variants >> (unsigned)which & 1U) == 0) {
      continue;
    }
    const double *at = (const double *)(const void *)((const char *)x + quantities[q].begin);
    supine_tensor tensor = {.name = quantities[q].name, .dtype = SUPINE_F64, .data = at};
    tensor.rank = quantities[q].rank;
    memcpy(tensor.shape, quantities[q].shape, sizeof tensor.shape);
    texts[q][0] = '\0';
    for (size_t i = 0; i < quantities[q].count; ++i) {
      floats[q][i] = (float)at[i];
      const size_t used = strlen(texts[q]);
      (void)snprintf(texts[q] + used, sizeof texts[q] - used, i > 0 ? ",%.9g" : "%.9g", at[i]);
    }
    switch (quantities[q].kind) {
    case FLOATS:
      tensor.dtype = SUPINE_F32;
      tensor.data = floats[q];
      tensors[tensor_count++] = tensor;
      break;
    case DOUBLES:
      tensors[tensor_count++] = tensor;
      break;
    case TEXT:
      metadata[metadata_count++] = (supine_metadata){quantities[q].name, texts[q]};
      break;
    case ARGUMENT:
      break;
    }
  }
  char *bytes = NULL;
  FILE *memory = open_memstream(&bytes, size);
  supine_fuzz_expect(memory != NULL, "memory for a file");
  supine_safetensors_print(memory, tensors, tensor_count, metadata, metadata_count);
  supine_fuzz_expect(fclose(memory) == 0, "memory for a file");
  return bytes;
}

static bool are_finite(size_t count, const double *x) {
  for (size_t i = 0; i < count; ++i) {
    if (!isfinite(x[i])) {
      return false;
    }
  }
  return true;
}

static bool are_finite_floats(size_t count, const float *x) {
  for (size_t i = 0; i < count; ++i) {
    if (!isfinite(x[i])) {
      return false;
    }
  }
  return true;
}

/* Expect that an argument that is not finite was refused as an argument. */
static void expect_refused(bool sound_arguments, supine_status status, const char *words) {
  supine_fuzz_expect(sound_arguments || status == SUPINE_ERROR_ARGUMENT, words);
}

static void evaluate(const supine_basis *basis, const supine_pose *pose) {
  float xyz[3 * N];
  float normals[3 * N];
  double volumes[LUNGS];
  const supine_status status = supine_deform_lit(basis, pose, xyz, normals);
  const bool given = are_finite(1, pose->weights) && are_finite(3 * LUNGS, pose->gains[0]);
  expect_refused(given, status, "a pose that is not finite to be refused");
  if (status == SUPINE_OK) {
    supine_fuzz_expect(are_finite_floats(3 * N, xyz), "finite positions");
    supine_fuzz_expect(are_finite_floats(3 * N, normals), "finite normals");
    supine_fuzz_expect(isfinite(supine_basis_error(basis, pose)), "a finite error of storage");
    supine_fuzz_expect(supine_basis_volumes(basis, pose, volumes) == SUPINE_OK &&
                           are_finite(LUNGS, volumes),
                       "finite volumes");
  }
}

/* Expect that normals of positions that are not finite are finite: 0 beside such a vertex. */
static void find_normals(const supine_basis *basis, const numbers *x) {
  float xyz[3 * N];
  float normals[3 * N];
  memcpy(xyz, supine_basis_vertices(basis), sizeof xyz);
  for (size_t k = 0; k < 3; ++k) {
    xyz[k] = (float)x->position[k];
  }
  supine_normals(basis, xyz, normals);
  supine_fuzz_expect(are_finite_floats(3 * N, normals), "finite normals of any positions");
}

static void pose_state(const supine_basis *basis, const supine_state *state, bool given) {
  supine_pose pose = {.basis = 0};
  float sigma[N];
  supine_status status = supine_basis_pose(basis, state, &pose, NULL);
  expect_refused(given, status, "a state that is not finite to be refused");
  if (status == SUPINE_OK) {
    evaluate(basis, &pose);
  }
  status = supine_expected_error(basis, state, NULL, sigma, NULL);
  if (supine_basis_get_info(basis)->is_fields && status == SUPINE_ERROR_UNSUPPORTED) {
    return; /* fields whose fit has no errors of vertices */
  }
  expect_refused(given, status, "a state that is not finite to be refused");
  if (status == SUPINE_OK) {
    supine_fuzz_expect(are_finite_floats(N, sigma), "finite expected errors");
  }
}

static void pose_all(const supine_basis *basis, const numbers *x) {
  supine_state state = {.gravity = {x->gravity[0], x->gravity[1], x->gravity[2]}};
  const bool gravity = are_finite(3, x->gravity);
  for (int k = 0; k < SUPINE_VOLUME_KIND_COUNT; ++k) {
    state.volume = (supine_volume){(supine_volume_kind)k, x->volume};
    pose_state(basis, &state, gravity && isfinite(x->volume));
  }
  state.lung_count = LUNGS;
  for (size_t lung = 0; lung < LUNGS; ++lung) {
    (void)strcpy(state.lungs[lung].name, lung == 0 ? "left" : "right");
    state.lungs[lung].volume = (supine_volume){SUPINE_VOLUME_REST, x->lung_volume[lung]};
  }
  pose_state(basis, &state, gravity && are_finite(LUNGS, x->lung_volume));
  supine_pose own = {.weights = {x->weight}};
  memcpy(own.gains, x->gains, sizeof x->gains);
  evaluate(basis, &own);
}

static void find_points(const supine_basis *basis, const numbers *x) {
  const supine_observation points[] = {
      {0, {x->position[0], x->position[1], x->position[2]}, x->noise},
      {3, {152.0, -80.0, 1.0}, 2.0},
      {7, {-240.0, 1.0, 2.0}, 2.0},
  };
  const supine_locate_task task = {.inside = basis,
                                   .count = sizeof points / sizeof *points,
                                   .observed = points,
                                   .state = {.gravity = {0.0, 1.0, 0.0}}};
  supine_locate_residual residuals[3];
  double space[4096];
  const supine_location *location = NULL;
  supine_fuzz_expect(supine_locate_space(3) <= sizeof space / sizeof *space, "enough work space");
  const supine_status status = supine_locate(&task, residuals, space, &location, NULL);
  expect_refused(are_finite(3, x->position) && isfinite(x->noise), status,
                 "an observed point that is not finite to be refused");
  if (status == SUPINE_OK) {
    float xyz[3 * N];
    float sigma[N];
    supine_fuzz_expect(supine_locate_positions(location, basis, xyz, sigma, NULL) != SUPINE_OK ||
                           (are_finite_floats(3 * N, xyz) && are_finite_floats(N, sigma)),
                       "finite positions of located lungs");
  }
}

static void breathe(const numbers *x) {
  double volume = 0.0;
  double pressure = 0.0;
  for (int course = 0; course < SUPINE_PV_COURSE_COUNT; ++course) {
    const supine_pv_breath breath = {x->breath[0], x->breath[1], x->breath[2], x->breath[3],
                                     (supine_pv_course)course};
    const supine_status status = supine_breath_evaluate(supine_breath_normal(), &breath, 1,
                                                        &x->time, &volume, &pressure, NULL);
    expect_refused(are_finite(4, x->breath) && isfinite(x->time), status,
                   "a breath that is not finite to be refused");
    supine_fuzz_expect(status != SUPINE_OK || (isfinite(volume) && isfinite(pressure)),
                       "a finite volume and pressure");
  }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
  numbers x = sound();
  for (size_t at = 0; at + 3 <= size && at < 30; at += 3) {
    change(&x, bytes + at);
  }
  size_t length = 0;
  char *file = write_basis(&x, (variant)(size % VARIANTS), &length);
  supine_basis *basis = NULL;
  supine_error error = {0};
  const supine_status status = supine_basis_open_memory(file, length, &basis, &error);
  supine_fuzz_expect(status == SUPINE_OK || status == SUPINE_ERROR_FORMAT,
                     "a basis, or an error of the format");
  supine_fuzz_expect(size >= 3 || status == SUPINE_OK, "a basis without changes to be accepted");
  if (status == SUPINE_OK) {
    pose_all(basis, &x);
    find_points(basis, &x);
    find_normals(basis, &x);
  }
  breathe(&x);
  supine_basis_close(basis);
  free(file);
  return 0;
}

/* Return every change of one quantity in each variant, and first none at all. */
uint8_t *supine_fuzz_seed(size_t index, size_t *size) {
  uint8_t *bytes = calloc(3 + VARIANTS, 1);
  supine_fuzz_expect(bytes != NULL, "memory for a seed");
  *size = (index < VARIANTS ? 0 : 3) + index % VARIANTS;
  if (index / VARIANTS > (size_t)QUANTITIES * WAYS * VALUES) {
    free(bytes);
    return NULL;
  }
  if (index >= VARIANTS) {
    const size_t number = index / VARIANTS - 1;
    bytes[0] = (uint8_t)(number / VALUES / WAYS);
    bytes[1] = (uint8_t)(number / VALUES % WAYS);
    bytes[2] = (uint8_t)(number % VALUES);
  }
  return bytes;
}
