/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine validate: a basis, or a patient's law, against another state of the same person. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include <supine/runtime.h>

#include "precompute/inside/biharmonic.h"
#include "precompute/patient/patient_file.h"
#include "precompute/patient/validate.h"
#include "runtime/options/basis_input.h"
#include "runtime/options/orientation.h"

static const char name[] = "validate";

typedef struct request {
  const char *state, *landmarks, *path;
  supine_orientation orientation;
  supine_mesh_load_options load;
  double volume, scale;
  bool has_volume, has_scale, reverse, json;
} request;

static const char *const axes[] = {"auto", "LPS", "RAS", NULL}; /* as supine_axes */

#define FILLS(member) SUPINE_FILLS(request, member)

static const supine_option table[] = {
    {"state", 0, "SURFACE", "the same lungs in another state, of any meshing", FILLS(state),
     .file = SUPINE_FILE_IN},
    {"landmarks", 0, "FILE",
     "points that are known in both states, as 'supine fit --landmarks' takes them",
     FILLS(landmarks), .file = SUPINE_FILE_IN},
    {"reverse", 0, NULL, "rest is the other one of the two", FILLS(reverse)},
    {"volume", 0, "ML",
     "of the state, above the basis's surface. Default: a patient's own state as it was fitted, "
     "else what the state's surface has more",
     FILLS(volume), SUPINE_SAYS_GIVEN(request, has_volume), .wants = "millilitres",
     .rivals = "breath"},
    {"scale", 0, "S", "breath scale instead", FILLS(scale), SUPINE_SAYS_GIVEN(request, has_scale),
     .wants = "a number", .rivals = "breath"},
    {"axes", 0, "LPS|RAS", "axes of the surface; default: its SPACE tag, else LPS",
     FILLS(load.axes), .choices = axes, .wants = "LPS or RAS"},
    {"output", 'o', "FILE",
     "the predicted surface, .ply or .vtp, with the way to the state's surface as its displacement "
     "(mm): where the error sits",
     FILLS(path), .file = SUPINE_FILE_OUT, .endings = ".ply or .vtp"},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {"json", 0, NULL, "prints JSON instead of text", FILLS(json)},
    {.name = NULL}};

/* What is validated: the basis, its patient where it has one, and what it predicts. */
typedef struct subject {
  supine_basis *basis;
  bool has_patient;
  supine_patient_record record;
  double gravity[3];
  double scale; /* breath scale */
  supine_mesh rest;
  double *predicted; /* [rest vertices, 3] */
  double *nearest;   /* [rest vertices, 3] */
  bool has_surface, has_points;
  supine_patient_distance surface[SUPINE_PATIENT_MAP_COUNT];
  supine_patient_distance points[SUPINE_PATIENT_MAP_COUNT];
} subject;

static void subject_free(subject *s) {
  supine_basis_close(s->basis);
  supine_mesh_free(&s->rest);
  free(s->predicted);
  free(s->nearest);
}

static bool ends_with(const char *text, const char *ending) {
  const size_t length = strlen(text);
  return length >= strlen(ending) && strcmp(text + length - strlen(ending), ending) == 0;
}

static supine_status open_subject(const char *path, subject *s, supine_error *error) {
  if (ends_with(path, ".json")) {
    s->has_patient = true;
    return supine_patient_read(path, &s->record, error);
  }
  supine_status status = supine_basis_open(path, &s->basis, error);
  if (status != SUPINE_OK) {
    return status;
  }
  const char *law = supine_basis_metadata(s->basis, "patient_law");
  if (law != NULL) {
    s->has_patient = true;
    status = supine_patient_parse(path, law, &s->record, error);
  }
  if (status == SUPINE_OK) {
    status = supine_options_basis_rest_mesh(s->basis, &s->rest);
    if (status != SUPINE_OK) {
      (void)supine_error_set(error, status, "%s: no memory for its surface", path);
    }
  }
  return status;
}

/* The breath scale: as asked, as the patient was fitted, or that of the state's volume. */
static supine_status find_scale(const request *wanted, subject *s, const double *weights,
                                const supine_mesh *state, supine_error *error) {
  if (wanted->has_scale) {
    s->scale = wanted->scale;
    return SUPINE_OK;
  }
  if (!wanted->has_volume && s->has_patient) {
    s->scale = s->record.inflation;
    return SUPINE_OK;
  }
  if (!wanted->has_volume && state->vertex_count == 0) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "how full is the other state? Landmarks do not tell: --volume ML above "
                            "the basis's surface, or --scale");
  }
  const double volume = wanted->has_volume
                            ? wanted->volume
                            : 1e-3 * (supine_mesh_volume(state) - supine_mesh_volume(&s->rest));
  return supine_basis_scale(s->basis, weights, volume, &s->scale, error);
}

/* Whether the patient's own law says where points inside go: in the state that it was fitted to. */
static bool law_says(const subject *s) {
  double off = 0.0;
  for (int k = 0; k < 3; ++k) {
    off = fmax(off, fabs(s->gravity[k] - s->record.state.gravity[k]));
  }
  return s->has_patient && off < 1e-9;
}

static supine_status predict_surface(const request *wanted, subject *s, const supine_mesh *state,
                                     supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(s->basis);
  const size_t n = s->rest.vertex_count;
  double *weights = malloc(info->mode_count * sizeof *weights);
  double *scales = malloc(info->lung_count * sizeof *scales);
  float *xyz = malloc(3 * n * sizeof *xyz);
  s->predicted = malloc(3 * n * sizeof *s->predicted);
  s->nearest = malloc(3 * n * sizeof *s->nearest);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (weights == NULL || scales == NULL || xyz == NULL || s->predicted == NULL ||
      s->nearest == NULL) {
    (void)supine_error_set(error, status, "no memory for %zu vertices", n);
  } else {
    status = supine_basis_weights(s->basis, s->gravity, weights);
  }
  if (status == SUPINE_OK) {
    status = find_scale(wanted, s, weights, state, error);
  }
  if (status == SUPINE_OK) {
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      scales[lung] = s->scale;
    }
    supine_deform(s->basis, weights, scales, xyz);
    for (size_t i = 0; i < n; ++i) {
      double motion[3] = {0.0, 0.0, 0.0};
      if (law_says(s)) { /* between the scans that it was fitted to */
        supine_patient_motion(&s->record.patient, s->rest.vertices + 3 * i, motion);
      }
      for (size_t k = 0; k < 3; ++k) {
        s->predicted[3 * i + k] = (double)xyz[3 * i + k] + motion[k];
      }
    }
  }
  free(weights);
  free(scales);
  free(xyz);
  return status;
}

/* Where points inside go: by the patient's law itself, with the motion between the scans that was
 * found with it, else by the biharmonic interpolation of the surface's displacement. */
static supine_status predict_points(const subject *s, const supine_patient_pairs *pairs,
                                    double *predicted, supine_error *error) {
  enum { CENTRES = 1500 };
  const size_t n = s->rest.vertex_count;
  supine_inside_biharmonic fit = {0};
  if (law_says(s)) {
    const double times = s->basis == NULL ? 1.0 : s->scale * s->record.inflation;
    for (size_t i = 0; i < pairs->count; ++i) {
      double u[3];
      double motion[3];
      supine_patient_displacement(&s->record.patient, pairs->from + 3 * i, u);
      supine_patient_motion(&s->record.patient, pairs->from + 3 * i, motion);
      for (size_t k = 0; k < 3; ++k) {
        predicted[3 * i + k] = pairs->from[3 * i + k] + times * u[k] + motion[k];
      }
    }
    return SUPINE_OK;
  }
  double *displacement = malloc(3 * n * sizeof *displacement);
  supine_status status = displacement == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY,
                                                                 "no memory for %zu vertices", n)
                                              : SUPINE_OK;
  for (size_t i = 0; i < 3 * n && status == SUPINE_OK; ++i) {
    displacement[i] = s->predicted[i] - s->rest.vertices[i];
  }
  if (status == SUPINE_OK) {
    status =
        supine_inside_biharmonic_fit(n, s->rest.vertices, 3, displacement, CENTRES, &fit, error);
  }
  if (status == SUPINE_OK) {
    status = supine_inside_biharmonic_evaluate(&fit, pairs->count, pairs->from, predicted, error);
  }
  for (size_t i = 0; i < 3 * pairs->count && status == SUPINE_OK; ++i) {
    predicted[i] += pairs->from[i];
  }
  supine_inside_biharmonic_free(&fit);
  free(displacement);
  return status;
}

static supine_status check_points(const subject *s, const supine_patient_pairs *pairs,
                                  supine_error *error) {
  double low[3];
  double high[3];
  supine_mesh_box(&s->rest, low, high);
  size_t outside = 0;
  for (size_t i = 0; i < pairs->count && s->basis != NULL; ++i) {
    const double *p = pairs->from + 3 * i;
    outside += p[0] < low[0] || p[0] > high[0] || p[1] < low[1] || p[1] > high[1] ||
               p[2] < low[2] || p[2] > high[2];
  }
  return 2 * outside <= pairs->count
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                "%zu of %zu landmarks lie outside of the basis's box: another "
                                "frame, unit or person; or --reverse",
                                outside, pairs->count);
}

static supine_status validate_points(const request *wanted, subject *s, supine_error *error) {
  supine_patient_pairs pairs = {0};
  double *predicted = NULL;
  supine_status status =
      supine_patient_pairs_load(wanted->landmarks, wanted->reverse, &pairs, error);
  if (status == SUPINE_OK) {
    status = supine_patient_pairs_check(&pairs, s->has_patient, error);
  }
  if (status == SUPINE_OK) {
    status = check_points(s, &pairs, error);
  }
  if (status == SUPINE_OK) {
    predicted = malloc(3 * pairs.count * sizeof *predicted);
    status = predicted == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY,
                                                  "no memory for %zu "
                                                  "landmarks",
                                                  pairs.count)
                               : predict_points(s, &pairs, predicted, error);
  }
  if (status == SUPINE_OK) {
    status = supine_patient_validate_points(&pairs, predicted, s->points, error);
    s->has_points = true;
  }
  free(predicted);
  supine_patient_pairs_free(&pairs);
  return status;
}

static supine_status validate(const request *wanted, subject *s, supine_error *error) {
  supine_mesh state = {0};
  supine_status status = SUPINE_OK;
  if (wanted->state != NULL) {
    status = supine_mesh_load(wanted->state, &wanted->load, &state, NULL, error);
  }
  if (status == SUPINE_OK && s->basis != NULL) {
    status = predict_surface(wanted, s, &state, error);
  }
  if (status == SUPINE_OK && wanted->state != NULL) {
    status = supine_patient_validate_surface(&s->rest, s->predicted, &state, s->nearest, s->surface,
                                             error);
    s->has_surface = true;
  }
  if (status == SUPINE_OK && wanted->landmarks != NULL) {
    status = validate_points(wanted, s, error);
  }
  if (status == SUPINE_OK && wanted->path != NULL) {
    const supine_mesh shown = {s->rest.vertex_count, s->predicted, s->rest.triangle_count,
                               s->rest.triangles};
    const supine_mesh_save_options save = {.rest = s->nearest};
    status = supine_mesh_save(wanted->path, &shown, &save, error);
  }
  supine_mesh_free(&state);
  return status;
}

/* --- what is printed ------------------------------------------------------------------------- */

static void print_distances(const char *title, const char *largest,
                            const supine_patient_distance of[SUPINE_PATIENT_MAP_COUNT]) {
  (void)printf("%s, mm:\n  %-12s %7s %7s %7s %10s   explained\n", title, "", "mean", "RMS", "95 %",
               largest);
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    (void)printf("  %-12s %7.2f %7.2f %7.2f %10.2f   %7.1f %%\n", supine_patient_map_names[k],
                 of[k].mean, of[k].rms, of[k].p95, of[k].largest, 100.0 * of[k].explained);
  }
}

static void print_text(const subject *s) {
  if (s->has_surface) {
    print_distances("distance between the surfaces, both ways", "Hausdorff", s->surface);
  }
  if (s->has_points) {
    print_distances("distance of the landmarks", "largest", s->points);
  }
  (void)puts("translation, rigid+scale and affine are fitted to the other state itself\n"
             "for comparison, the paper: surfaces within 2 mm, constants within 1 %");
  if (!s->has_points) {
    (void)puts("a small distance between surfaces does not prove the motion of what is in them: "
               "--landmarks");
  }
}

static json_t *encode(const supine_patient_distance of[SUPINE_PATIENT_MAP_COUNT]) {
  json_t *all = json_object();
  for (int k = 0; k < SUPINE_PATIENT_MAP_COUNT; ++k) {
    (void)json_object_set_new(all, supine_patient_map_names[k],
                              json_pack("{s:f, s:f, s:f, s:f, s:f}", "mean_mm", of[k].mean,
                                        "rms_mm", of[k].rms, "p95_mm", of[k].p95, "largest_mm",
                                        of[k].largest, "explained_percent",
                                        100.0 * of[k].explained));
  }
  return all;
}

static void print_json(const subject *s) {
  json_t *root = json_pack("{s:f, s:{s:f, s:f}}", "scale", s->scale, "paper", "surface_mm", 2.0,
                           "constants_percent", 1.0);
  if (s->has_surface) {
    (void)json_object_set_new(root, "surface", encode(s->surface));
  }
  if (s->has_points) {
    (void)json_object_set_new(root, "landmarks", encode(s->points));
  }
  (void)json_dumpf(root, stdout, JSON_INDENT(1) | JSON_REAL_PRECISION(9));
  (void)putchar('\n');
  json_decref(root);
}

static int run(void *chosen, const supine_arguments *given) {
  const request *wanted = chosen;
  subject s = {.scale = 1.0};
  supine_error error;
  int result = SUPINE_EXIT_OK;
  if (wanted->state == NULL && wanted->landmarks == NULL) {
    return supine_options_usage(name, "against what? Name --state or --landmarks");
  }
  if (wanted->path != NULL && wanted->state == NULL) {
    return supine_options_usage(name, "-o shows the way to a --state: name one");
  }
  if (open_subject(given->operand[0], &s, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
  } else if (s.basis == NULL && wanted->state != NULL) {
    result = supine_options_usage(name, "%s is a law without a surface: make a basis of it first",
                                  given->operand[0]);
  } else if (wanted->orientation.given || wanted->orientation.tilt != 0.0) {
    result = supine_options_orientation_finish(&wanted->orientation, name, s.gravity);
  } else {
    static const double supine[3] = {0.0, 1.0, 0.0};
    memcpy(s.gravity, s.has_patient ? s.record.state.gravity : supine, sizeof s.gravity);
  }
  if (result == SUPINE_EXIT_OK && s.basis == NULL && !law_says(&s)) {
    result = supine_options_usage(name, "%s alone knows its own posture only: make a basis of it",
                                  given->operand[0]);
  }
  if (result == SUPINE_EXIT_OK) {
    if (validate(wanted, &s, &error) != SUPINE_OK) {
      result = supine_options_fail(name, &error);
    } else {
      (wanted->json ? print_json : print_text)(&s);
      result = supine_options_finish(name);
    }
  }
  subject_free(&s);
  return result;
}

const supine_command supine_command_validate = {
    name,
    "how far a prediction is from another scan",
    .usage = "BASIS|PATIENT.json --state SURFACE|--landmarks PAIRS.csv [OPTIONS]",
    .about = "Compares a basis, or a patient's law, with another state of the same person: "
             "distances between the surfaces and of landmarks, and how much of the motion is "
             "explained, beside what no motion, a translation, a similarity and an affine map "
             "leave. The basis's surface is the state at rest.",
    .options = table,
    .notes = "Examples:\n"
             "  supine validate lungs.safetensors --state prone.ply --posture prone\n"
             "  supine validate patient.json --landmarks pairs.csv",
    .operands_least = 1,
    .operands_most = 1,
    .operands_missing = "name one basis file, or one patient.json",
    .request_size = sizeof(request),
    .run = run};
