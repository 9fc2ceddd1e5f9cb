/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine deform: a basis, a direction of gravity and a volume in, a deformed surface out. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/mesh.h"
#include "sh/base/csv.h"
#include "sh/base/output.h"
#include "sh/base/text.h"
#include "sh/base/vec3.h"
#include <supine/runtime.h>

#include "program/deform_content.h"
#include "program/options/basis_input.h"
#include "program/options/expected.h"
#include "program/options/orientation.h"
#include "program/options/state.h"

static const char name[] = "deform";

typedef struct request {
  supine_orientation orientation;
  supine_volume_options volume;
  supine_from from;
  bool has_scale, as_scanned;
  double scale;
  supine_deform_content content;
  const char *states; /* list of states */
  char *output;       /* output of a row of that list */
} request;

#define ENDINGS SUPINE_MESH_ENDINGS ", .csv, .nrrd, .nii, .nii.gz or .mha"

static const supine_option table[] = {
    {"output", 'o', "FILE",
     SUPINE_MESH_ENDINGS "; PLY and VTP carry the displacement and the expected error; what is "
                         "inside also goes into .csv, images into .nrrd, .nii, .nii.gz or .mha",
     SUPINE_FILLS(request, content.path), .file = SUPINE_FILE_OUT, .endings = ENDINGS,
     .rivals = "output"},
    {"states", 0, "LIST",
     "many states in one call, for which the basis and the image are read once: a CSV file with "
     "the columns posture, volume and output, a file beside the list: surface, points, field, or "
     "what --image or --labels moves",
     SUPINE_FILLS(request, states), .file = SUPINE_FILE_IN, .wants = "a CSV file",
     .rivals = "output"},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {"scale", 0, "MM", "largest displacement instead, mm: for open surfaces",
     SUPINE_FILLS(request, scale), SUPINE_SAYS_GIVEN(request, has_scale), .wants = "millimetres",
     .rivals = "breath"},
    {.table = supine_options_from, SUPINE_FILLS(request, from)},
    {.table = supine_options_as_scanned, SUPINE_FILLS(request, as_scanned)},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {.table = supine_command_deform_content_options, SUPINE_FILLS(request, content)},
    {.name = NULL}};

/* Positions of a pose as doubles, for measuring and saving; normals [N, 3] where they are not NULL.
 */
static supine_status deformed_mesh(const supine_basis *basis, const supine_pose *pose,
                                   supine_mesh *mesh, float *normals) {
  const size_t n = mesh->vertex_count;
  float *xyz = malloc(3 * n * sizeof *xyz);
  if (xyz == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_deform(basis, pose, xyz);
  if (normals != NULL) {
    supine_normals(basis, xyz, normals);
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    mesh->vertices[i] = (double)xyz[i];
  }
  free(xyz);
  return SUPINE_OK;
}

static double largest_displacement(const supine_mesh *rest, const supine_mesh *mesh) {
  double largest = 0.0;
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    const double *a = rest->vertices + 3 * i;
    const double *b = mesh->vertices + 3 * i;
    largest = fmax(largest, supine_distance(b, a));
  }
  return largest;
}

/* Compute the pose requested: by largest displacement from the reference surface, or by volumes. */
static int find_pose(const supine_basis *basis, const request *wanted, const double gravity[3],
                     supine_mesh *mesh, supine_pose *pose) {
  if (!wanted->has_scale) {
    return supine_options_pose(basis, name, &wanted->volume, gravity, pose);
  }
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  supine_mesh reference = {0};
  (void)supine_basis_weights(basis, gravity, pose->weights); /* a unit vector is legal */
  supine_pose_fill(pose, 1.0);
  if (supine_options_basis_rest_mesh(basis, &reference) != SUPINE_OK ||
      deformed_mesh(basis, pose, mesh, NULL) != SUPINE_OK) {
    supine_mesh_free(&reference);
    return supine_options_fail(name, &error);
  }
  const double largest = largest_displacement(&reference, mesh);
  supine_mesh_free(&reference);
  if (!(largest > 0.0)) {
    supine_options_say(name,
                       "nothing moves in this direction of gravity, so no --scale gives "
                       "%g mm: give another posture",
                       wanted->scale);
    return SUPINE_EXIT_NUMERICAL;
  }
  supine_pose_fill(pose, wanted->scale / largest);
  return SUPINE_EXIT_OK;
}

/* Print in one line the file written, the displacement and the volume. */
static void report(const char *path, const double gravity[3], const supine_mesh *mesh,
                   const supine_mesh *from, const char *reference, bool volumes) {
  (void)printf("%s: gravity %.4g,%.4g,%.4g, largest displacement %.3f mm from %s", path, gravity[0],
               gravity[1], gravity[2], largest_displacement(from, mesh), reference);
  if (volumes) {
    const double held = 1e-3 * supine_mesh_volume(mesh);
    (void)printf(", %.2f mL (%+.2f mL)", held, held - 1e-3 * supine_mesh_volume(from));
  }
  (void)putchar('\n');
}

/* Over 60 lines: what a surface needs is made in one place and freed in one. */
static int deform(const supine_basis *basis, const request *wanted, const double gravity[3]) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_pose pose;
  supine_reference_pose reference;
  supine_expected expected = {0};
  supine_state state = wanted->volume.state;
  supine_mesh from = {0};
  supine_mesh mesh = {0};
  float *normals = NULL;
  char comment[128];
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  int result = SUPINE_EXIT_OK;
  if (supine_options_basis_rest_mesh(basis, &from) != SUPINE_OK ||
      supine_options_basis_rest_mesh(basis, &mesh) != SUPINE_OK ||
      supine_options_reference(basis, &wanted->from, false, &reference, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  result = find_pose(basis, wanted, gravity, &mesh, &pose);
  if (result != SUPINE_EXIT_OK) {
    goto cleanup;
  }
  memcpy(state.gravity, gravity, sizeof state.gravity);
  if (!wanted->has_scale && supine_options_expected_find(basis, &state, &reference.state, &expected,
                                                         &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  (void)snprintf(comment, sizeof comment, "displacement from %s", reference.name);
  supine_mesh_save_options save = {.rest = from.vertices, .comment = comment};
  result = supine_options_basis_frame(basis, name, wanted->as_scanned, &save);
  if (result == SUPINE_EXIT_OK && supine_command_deform_content_wanted(&wanted->content)) {
    result = supine_command_deform_content(&wanted->content, name, basis, &pose, &reference,
                                           wanted->from.given, &expected, &save);
    goto cleanup;
  }
  if (result != SUPINE_EXIT_OK) {
    goto cleanup;
  }
  const supine_tensor *lung = supine_basis_tensor(basis, "lung");
  double volumes[SUPINE_LUNGS_MAX];
  const supine_mesh_field fields[] = {{"gravity_LPS", 3, gravity},
                                      {"volume_mL", info->lung_count, volumes}};
  if (info->has_volume) {
    supine_basis_volumes(basis, &pose, volumes);
  }
  normals = malloc(3 * mesh.vertex_count * sizeof *normals);
  if (normals == NULL || deformed_mesh(basis, &reference.pose, &from, NULL) != SUPINE_OK ||
      deformed_mesh(basis, &pose, &mesh, normals) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  save.normals = mesh.triangle_count > 0 ? normals : NULL; /* points have no volume */
  save.expected_error = expected.sigma;
  save.lung = lung == NULL ? NULL : lung->data;
  save.fields = fields;
  save.field_count = info->has_volume ? 2 : 1;
  if (supine_mesh_save(wanted->content.path, &mesh, &save, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  report(wanted->content.path, gravity, &mesh, &from, reference.name,
         info->has_volume && supine_basis_metadata(basis, "content") == NULL);
  supine_options_expected_print(&expected, stdout);
  result = supine_options_finish(name);
cleanup:
  supine_options_expected_free(&expected);
  supine_mesh_free(&from);
  supine_mesh_free(&mesh);
  free(normals);
  return result;
}

/* Fill a request with the state and the output of a row of --states. */
static int read_row(const supine_csv *csv, request *row) {
  const char *const output = supine_csv_text(csv, 1);
  const char *const volume = supine_csv_text(csv, 2);
  supine_state *state = &row->volume.state;
  supine_error error;
  state->gravity[1] = 1.0; /* supine, unless the row says otherwise */
  supine_status status = supine_state_parse(supine_csv_text(csv, 0), state, &error);
  if (status == SUPINE_OK && volume != NULL && volume[0] != '\0') {
    status = supine_state_parse_volume(volume, state, &error);
  }
  if (status != SUPINE_OK) {
    return supine_options_usage(name, "%s:%zu: %s", csv->path, csv->line, error.message);
  }
  const bool voxels = supine_image_supports(output);
  const bool image = row->content.image != NULL || row->content.labels != NULL;
  if (!voxels && !supine_mesh_save_supports(output) &&
      !supine_text_ends_in_any_case(output, ".csv")) {
    return supine_options_usage(name, "%s:%zu: %s: the name must end in %s", csv->path, csv->line,
                                output, ENDINGS);
  }
  memcpy(row->orientation.gravity, state->gravity, sizeof state->gravity);
  row->orientation.given = true;
  row->output = supine_path_beside(csv->path, output);
  *(voxels && !image ? &row->content.field : &row->content.path) = row->output;
  return row->output == NULL
             ? supine_options_fail(name, &(supine_error){SUPINE_ERROR_MEMORY, "out of memory"})
             : supine_command_deform_content_check(&row->content, name);
}

/* Check that the output of the last row is no input and no other row's output, and can be
 * written. */
static int check_row(const char *basis, const request *rows, size_t count) {
  const request *row = &rows[count - 1];
  const char *const inputs[] = {basis, row->states, row->content.image, row->content.labels};
  supine_error error;
  for (size_t i = 0; i < sizeof inputs / sizeof *inputs; ++i) {
    if (inputs[i] != NULL &&
        supine_options_check_output(name, row->output, inputs[i]) != SUPINE_EXIT_OK) {
      return SUPINE_EXIT_USAGE;
    }
  }
  for (size_t i = 0; i + 1 < count; ++i) {
    if (strcmp(rows[i].output, row->output) == 0) {
      return supine_options_usage(name, "%s: two rows write %s: give each its own file",
                                  row->states, row->output);
    }
  }
  return supine_output_try(row->output, &error) == SUPINE_OK ? SUPINE_EXIT_OK
                                                             : supine_options_fail(name, &error);
}

/* Requests for the rows of --states, all checked before any work. */
static int read_rows(const char *basis, const request *wanted, request **rows, size_t *count) {
  static const char *const columns[] = {"posture", "output", "volume"};
  supine_csv csv;
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  supine_status status = supine_csv_open(wanted->states, columns, 3, 2, &csv, &error);
  bool more = true;
  int result = status == SUPINE_OK ? SUPINE_EXIT_OK : supine_options_fail(name, &error);
  if (result == SUPINE_EXIT_OK && wanted->orientation.given) {
    result = supine_options_usage(name, "give a posture or --states, not both");
  }
  while (result == SUPINE_EXIT_OK && more) {
    request *grown = realloc(*rows, (*count + 1) * sizeof **rows);
    *rows = grown != NULL ? grown : *rows;
    if (grown == NULL || supine_csv_next(&csv, &more, &error) != SUPINE_OK) {
      result = supine_options_fail(name, &error);
    } else if (more) {
      grown[*count] = *wanted;
      result = read_row(&csv, &grown[(*count)++]);
      result = result == SUPINE_EXIT_OK ? check_row(basis, grown, *count) : result;
    }
  }
  supine_csv_close(&csv);
  return result == SUPINE_EXIT_OK && *count == 0
             ? supine_options_usage(name, "%s: no row follows the header: add at least one",
                                    wanted->states)
             : result;
}

static int run(void *chosen, const supine_arguments *given) {
  request *wanted = chosen;
  const bool many = wanted->states != NULL;
  request *rows = many ? NULL : wanted;
  size_t count = many ? 0 : 1;
  supine_basis *basis = NULL;
  supine_error error;
  double gravity[3];
  int result = many ? read_rows(given->operand[0], wanted, &rows, &count)
                    : supine_command_deform_content_check(&wanted->content, name);
  if (result == SUPINE_EXIT_OK && !many) {
    result = supine_options_orientation_finish(&wanted->orientation, name, gravity);
  }
  if (result == SUPINE_EXIT_OK && supine_options_basis_open(given->operand[0], SUPINE_STORAGE_EXACT,
                                                            &basis, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
  }
  if (result == SUPINE_EXIT_OK) {
    result = supine_command_deform_content_read(&wanted->content, name);
  }
  for (size_t i = 0; i < count && result == SUPINE_EXIT_OK; ++i) {
    rows[i].content.source = wanted->content.source;
    (void)supine_options_orientation_finish(&rows[i].orientation, name, gravity); /* was given */
    result = deform(basis, &rows[i], gravity);
  }
  for (size_t i = 0; i < count; ++i) {
    free(rows[i].output);
  }
  free(many ? rows : NULL);
  supine_image_free(&wanted->content.source);
  supine_basis_close(basis);
  return result;
}

const supine_command supine_command_deform = {
    name,
    "deform a basis for a posture and a volume",
    .usage = "BASIS --posture NAME [--volume VOLUME] -o FILE\n"
             "BASIS --states LIST",
    .about = "Deforms the lungs of a basis file for any direction of gravity and any volume and "
             "writes the surface, as the run-time library does in each frame. Each point carries "
             "its expected error, expected_error_mm: " SUPINE_EXPECTED_MEANING
             ". " SUPINE_EXPECTED_SUPPORT,
    .options = table,
    .notes =
        "Examples:\n"
        "  supine deform lungs.safetensors --posture prone --volume rest+500 -o prone.vtp\n"
        "  supine deform lungs.safetensors --gravity 0.6,0,-0.8 --volume left=rest,right=rest+250 "
        "-o out.ply\n"
        "  supine deform nodules.safetensors --posture prone --from supine:rest -o nodules.csv\n"
        "  supine deform grid.safetensors --posture prone --image ct.nii.gz --density -o "
        "prone.nii.gz\n"
        "  supine deform grid.safetensors --states list.csv --image ct.nii.gz --density",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
