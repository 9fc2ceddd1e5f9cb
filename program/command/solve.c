/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine solve: solve the full physics for one direction of gravity. */
#include <math.h>

#include "base/arena.h"
#include "base/csv.h"
#include "base/output.h"
#include "base/text.h"
#include "base/vec3.h"
#include "precompute/lungs/disease.h"
#include "precompute/physics/solve.h"

#include "program/command/list.h"
#include "program/command/solve_iterate.h"
#include "program/options/model_options.h"
#include "program/options/state_options.h"

static const char name[] = "solve";

typedef struct request {
  supine_model_options model;
  supine_orientation orientation;
  const char *path;
  supine_state state; /* the kind of its volume is SUPINE_VOLUME_DEFAULT if none is given */
  bool has_vertex, pitcher_catcher, allow_folds;
  size_t vertex;
} request;

static const supine_option table[] = {
    {"output", 'o', "FILE", SUPINE_MESH_ENDINGS "; PLY and VTP files include displacements",
     SUPINE_FILLS(request, path), .required = true, .file = SUPINE_FILE_OUT},
    {"volume", 0, "VOLUME",
     SUPINE_VOLUME_HELP ". Default rest; if rest is unknown (--scanned none, --law paper), the "
                        "solved displacement, without scaling to a volume",
     SUPINE_FILLS(request, state), .read = supine_options_read_volume},
    {.table = supine_options_folds, SUPINE_FILLS(request, allow_folds)},
    {"unit-force", 0, "VERTEX",
     "instead of a posture: write to -o FILE.csv the response of every vertex to a unit force on "
     "this vertex (numbered from 0)",
     SUPINE_FILLS(request, vertex), SUPINE_SAYS_GIVEN(request, has_vertex),
     .wants = "the number of a vertex", .more = true},
    {"pitcher-catcher", 0, NULL,
     "solve by the iteration of Santhanam 2008, which always distributes the force of the node "
     "with the largest remaining force. Also prints the share of the force not yet balanced, and "
     "the largest difference from the direct solution. Slow, so for small meshes. Needs --law "
     "paper",
     SUPINE_FILLS(request, pitcher_catcher), .more = true},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {.table = supine_options_model, SUPINE_FILLS(request, model)},
    {.name = NULL}};

/* Write a CSV file of the response of every vertex to a unit force on the vertex that --unit-force
 * gives. */
static supine_status write_column(const supine_prepared *prepared, const request *wanted,
                                  supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const size_t n = lungs->mesh.vertex_count;
  supine_equilibrium *equilibrium = NULL;
  supine_output output = {0};
  SUPINE_ARENA arena = {0};
  double *column = supine_arena_take(&arena, n, sizeof *column);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
  supine_status status =
      supine_physics_model_equilibrium(lungs, &prepared->model, &equilibrium, error);
  if (status == SUPINE_OK) {
    status = supine_physics_transfer_column(equilibrium, wanted->vertex, column, error);
  }
  supine_physics_equilibrium_destroy(equilibrium);
  SUPINE_TRY(status);
  SUPINE_TRY(supine_output_open(wanted->path, &output, error));
  (void)fputs("vertex,x_mm,y_mm,z_mm,response\n", output.file);
  for (size_t i = 0; i < n; ++i) {
    const double *p = lungs->mesh.vertices + 3 * i;
    supine_csv_row row = {.file = output.file};
    supine_csv_add(&row, "%zu,%.9g,%.9g,%.9g,%.17g", i, p[0], p[1], p[2], column[i]);
    supine_csv_end_row(&row);
  }
  SUPINE_ADD_RESULT(json_pack("{s:o, s:I, s:I}", "file", supine_options_json_text(wanted->path),
                              "vertex", (json_int_t)wanted->vertex, "vertices", (json_int_t)n));
  return supine_output_commit(&output, error);
}

/* Compute each lung's volume minus the volume of its reference surface, mL, as if no lung had
 * collapsed. */
static supine_status find_volumes(const supine_reference *reference, const supine_state *state,
                                  double *ml, supine_error *error) {
  const double *g = state->gravity;
  const double *full = reference->full_volume;
  const double *scan = reference->scan_volume;
  const supine_volume_kind kind = state->volume.kind;
  double part[2];
  SUPINE_REFUSE_IF(state->lung_count > 0, error, SUPINE_ERROR_ARGUMENT,
                   "--volume: 'supine solve' takes one volume of all lungs together, not a volume "
                   "for each lung");
  double total = state->volume.ml;
  switch (kind) {
  case SUPINE_VOLUME_ABSOLUTE:
    break;
  case SUPINE_VOLUME_SCAN:
    total += full[0] + full[1] + scan[0] + scan[1];
    break;
  case SUPINE_VOLUME_FULL:
    total += supine_physics_reference_full(reference, g, part);
    break;
  default:
    total += supine_physics_reference_rest(reference, g, part);
    break;
  }
  supine_physics_reference_share_out(reference, g, total, ml);
  for (size_t lung = 0; lung < reference->lung_count; ++lung) {
    ml[lung] -= full[lung];
  }
  return SUPINE_OK;
}

/* Find the gains (factors on each lung's displacement along x, y and z) that give each lung its
 * volume. If the volume at rest is unknown, all gains are equal, and 1 if --volume is missing. */
static supine_status find_gains(const supine_prepared *prepared, const request *wanted,
                                const supine_solution *solution, double gains[2][3],
                                supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const supine_reference *reference = &prepared->reference;
  const supine_volume *volume = &wanted->state.volume;
  double scale = 1.0;
  if (!reference->known && volume->kind != SUPINE_VOLUME_DEFAULT) {
    SUPINE_REFUSE_IF(volume->kind != SUPINE_VOLUME_SCAN && volume->kind != SUPINE_VOLUME_ABSOLUTE,
                     error, SUPINE_ERROR_ARGUMENT,
                     "rest and full are unknown with --scanned none: give scan+ML or an absolute "
                     "volume, such as 2600mL");
    const double held =
        volume->kind == SUPINE_VOLUME_ABSOLUTE ? lungs->volume[0] + lungs->volume[1] : 0.0;
    SUPINE_TRY(supine_volume_scale(solution->cubic, volume->ml - held, &scale, error));
  }
  for (size_t i = 0; i < 6; ++i) {
    gains[i / 3][i % 3] = scale;
  }
  if (!reference->known) {
    return SUPINE_OK;
  }
  const supine_model *model = &prepared->model;
  double ml[2];
  double rest[2];
  (void)supine_physics_reference_rest(reference, wanted->state.gravity, rest);
  SUPINE_TRY(find_volumes(reference, &wanted->state, ml, error));
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    const double share = model->share[lung];
    SUPINE_TRY(supine_volume_form_gains(&solution->form[lung], model->bend,
                                        share * (rest[lung] - reference->full_volume[lung]),
                                        share * ml[lung], gains[lung], error));
  }
  return SUPINE_OK;
}

static void print_gains(const supine_lungs *lungs, double gains[2][3]) {
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    const double *gain = gains[lung];
    supine_options_line(", %s lung's gain %.6g", supine_lungs_name(lungs, lung), gain[0]);
    if (gain[1] != gain[0] || gain[2] != gain[0]) {
      supine_options_line(",%.6g,%.6g", gain[1], gain[2]);
    }
  }
}

/* Return the gains of x, y and z of each lung, by its name. */
static json_t *list_gains(const supine_lungs *lungs, double gains[2][3]) {
  json_t *list = json_object();
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    (void)json_object_set_new(list, supine_lungs_name(lungs, lung),
                              supine_options_json_numbers(3, gains[lung]));
  }
  return list;
}

/* Scale a solution to the volume that --volume gives, and write the deformed surface. */
static supine_status write_solution(const supine_prepared *prepared, const request *wanted,
                                    supine_solution *solution, supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const double *g = wanted->state.gravity;
  const size_t values = 3 * lungs->mesh.vertex_count;
  SUPINE_ARENA arena = {0};
  supine_mesh deformed = lungs->mesh;
  supine_mesh reference = lungs->mesh;
  double gains[2][3];
  SUPINE_TRY(find_gains(prepared, wanted, solution, gains, error));
  deformed.vertices = supine_arena_take(&arena, values, sizeof(double));
  reference.vertices = supine_arena_take(&arena, values, sizeof(double));
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", deformed.vertex_count));
  supine_lungs_collapse(lungs, prepared->model.share, lungs->mesh.vertices, reference.vertices);
  for (size_t i = 0; i < values; ++i) {
    solution->directions[i] *=
        gains[lungs->lung_count == 2 && i >= 3 * lungs->lung_begin[1]][i % 3];
  }
  supine_physics_solution_apply(solution, &lungs->mesh, 1.0, deformed.vertices);
  supine_lungs_collapse(lungs, prepared->model.share, deformed.vertices, deformed.vertices);
  const bool known = prepared->reference.known;
  const double full = 1e-3 * supine_mesh_volume(&reference);
  const double volume = 1e-3 * supine_mesh_volume(&deformed);
  const supine_plausible result = {.command = name,
                                   .state = &wanted->state,
                                   .volume = volume,
                                   .full = known ? full : 0.0,
                                   .folded = supine_mesh_turned_over(&reference, deformed.vertices),
                                   .parts = "the surface folds; triangles that turn over",
                                   .allowed = wanted->allow_folds || !known};
  const supine_mesh_save_options save = {.from = reference.vertices};
  double largest = 0.0;
  for (size_t i = 0; i < values; i += 3) {
    largest = fmax(largest, supine_distance(deformed.vertices + i, reference.vertices + i));
  }
  SUPINE_TRY(supine_options_plausible(&result, error));
  SUPINE_TRY(supine_mesh_save(wanted->path, &deformed, &save, error));
  supine_options_line("%s: gravity %.4g,%.4g,%.4g", wanted->path, g[0], g[1], g[2]);
  print_gains(lungs, gains);
  supine_options_line(", largest displacement %s mm, %+.2f mL\n",
                      supine_text_distance(largest).text, volume - full);
  SUPINE_ADD_RESULT(json_pack(
      "{s:o, s:o, s:o, s:f, s:f, s:f}", "file", supine_options_json_text(wanted->path), "gravity",
      supine_options_json_numbers(3, g), "gains", list_gains(lungs, gains),
      "largest_displacement_mm", largest, "volume_ml", volume, "volume_change_ml", volume - full));
  return SUPINE_OK;
}

static supine_status solve(const supine_prepared *prepared, const request *wanted,
                           supine_error *error) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const double *g = wanted->state.gravity;
  SUPINE_FREED_BY(supine_physics_solution_free) supine_solution solution = {0};
  SUPINE_TRY(supine_physics_solve(lungs, &prepared->model, g, &solution, error));
  if (wanted->pitcher_catcher) {
    SUPINE_TRY(supine_command_iterate(lungs, &prepared->model, g, &solution, error));
  }
  return write_solution(prepared, wanted, &solution, error);
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  SUPINE_FREED_BY(supine_precompute_prepared_free)
  supine_prepared prepared = {.source = {.is_map = false}};
  if (wanted->has_vertex) { /* the response is that of the surface as it is */
    wanted->model.precompute.scan.shown = SUPINE_SHOWN_UNKNOWN;
  } else if (!supine_mesh_save_supports(wanted->path)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "%s: the name must end in " SUPINE_MESH_ENDINGS, wanted->path);
  } else {
    SUPINE_TRY(supine_options_state(&wanted->orientation, &wanted->state, error));
  }
  SUPINE_TRY(supine_options_prepare(name, &wanted->model, given, &prepared, error));
  return wanted->has_vertex ? write_column(&prepared, wanted, error)
                            : solve(&prepared, wanted, error);
}

const supine_command supine_command_solve = {
    name,
    "solve the full physics for one posture",
    .usage = "MESH... --posture NAME -o FILE [OPTIONS]\n"
             "LABELS... --posture NAME -o FILE [OPTIONS]",
    .about = "Solves the full physics for one direction of gravity, without harmonics, and writes "
             "the deformed surface: the reference against which a basis is measured. MESH and "
             "LABELS are as for 'supine precompute'.",
    .options = table,
    .notes = "Examples:\n"
             "  supine solve left.ply right.ply --posture prone --volume rest+500 -o prone.vtp\n"
             "  supine solve lungs.nii.gz --posture left -o left.vtp",
    SUPINE_SURFACES,
    .request_size = sizeof(request),
    .uses_blas = true,
    .run = run};
