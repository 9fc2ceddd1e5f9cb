/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine locate: find the whole lung from a few observed points. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <supine/locate.h>

#include "sh/base/output.h"

#include "program/inside.h"
#include "program/located.h"
#include "program/observed.h"
#include "program/options/basis_input.h"
#include "program/options/state_options.h"

static const char name[] = "locate";

typedef struct request {
  const char *output, *points;
  supine_orientation orientation;
  supine_state state; /* its volume is the default where none was given */
  double noise;
  bool rigid;
} request;

static const supine_option table[] = {
    {"points", 0, "FILE", "positions of the points in the scan, made by 'supine embed BASIS'",
     SUPINE_FILLS(request, points), .file = SUPINE_FILE_IN, .required = true},
    {"output", 'o', "FILE",
     ".vtp or .ply: the lungs' surface; .csv: everything in the file of --points. Both in the "
     "frame of the observations, with the expected error of each point",
     SUPINE_FILLS(request, output), .file = SUPINE_FILE_OUT, .required = true,
     .endings = ".vtp, .ply or .csv"},
    {"volume", 0, "VOLUME", SUPINE_VOLUME_HELP "; default: fitted to the points",
     SUPINE_FILLS(request, state), .read = supine_options_read_volume},
    {"rigid", 0, NULL,
     "also fit a rotation, from three points or more; default: a translation alone",
     SUPINE_FILLS(request, rigid)},
    {"noise", 0, "MM", "standard deviation of an observed coordinate", SUPINE_FILLS(request, noise),
     .standard = "2", SUPINE_ABOVE_ZERO, .wants = "millimetres"},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {.name = NULL}};

/* Write the lungs' surface, with the expected error of each vertex. */
static supine_status write_surface(const char *path, const supine_basis *basis,
                                   const supine_command_located *located, supine_error *error) {
  const supine_tensor *lung = supine_basis_tensor(basis, "lung");
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  supine_mesh mesh = {0};
  double volume = located->best->volume;
  const supine_mesh_field fields[] = {{"gravity_LPS", 3, located->best->state.gravity},
                                      {"volume_mL", 1, &volume}};
  const supine_mesh_save_options save = {.comment = "in the frame of the observations",
                                         .expected_error = located->sigma,
                                         .lung = lung == NULL ? NULL : lung->data,
                                         .fields = fields,
                                         .field_count = 2};
  supine_status status = supine_options_basis_mesh(basis, &mesh);
  if (status != SUPINE_OK) {
    return supine_error_set(error, status, "no memory for %zu vertices", n);
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    mesh.vertices[i] = (double)located->xyz[i];
  }
  status = supine_mesh_save(path, &mesh, &save, error);
  supine_mesh_free(&mesh);
  return status;
}

static supine_status write_points(const char *path, const supine_basis *inside,
                                  const supine_command_names *names,
                                  const supine_command_located *located, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(inside);
  supine_output output = {0};
  supine_status status = supine_output_open(path, &output, error);
  if (status != SUPINE_OK) {
    return status;
  }
  (void)fputs("# mm, in the frame of the observations; expected_error_mm: " SUPINE_EXPECTED_MEANING
              "\nname,lung,x,y,z,expected_error_mm\n",
              output.file);
  for (size_t i = 0; i < info->vertex_count; ++i) {
    const size_t at = names->order[i];
    const float *p = located->xyz + 3 * at;
    (void)fprintf(output.file, "%s,%s,%.3f,%.3f,%.3f,%.3f\n", names->text[names->part[at]],
                  info->lung_names[supine_command_lung_of(info, at)], (double)p[0], (double)p[1],
                  (double)p[2], (double)located->sigma[at]);
  }
  return supine_output_commit(&output, error);
}

/* Print the result. */
static void tell(const request *wanted, const supine_command_names *names,
                 const supine_command_observed *observed, const supine_basis *basis,
                 const supine_command_located *located) {
  const supine_location *best = located->best;
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  double square = 0.0;
  double largest = 0.0;
  for (size_t i = 0; i < n; ++i) {
    const double sigma = (double)located->sigma[i];
    square += sigma * sigma;
    largest = fmax(largest, sigma);
  }
  (void)printf("%s: expected error %.1f mm (RMS of %zu points), %.1f mm at most; %s\n",
               wanted->output, sqrt(square / (double)n), n, largest, SUPINE_EXPECTED_MEANING);
  supine_command_located_tell(located, wanted->orientation.given);
  const double *t = best->translation;
  (void)printf("translation %.1f,%.1f,%.1f mm", t[0], t[1], t[2]);
  if (wanted->rigid) {
    const double *r = best->rotation;
    const double cosine = fmax(-1.0, fmin(1.0, 0.5 * (r[0] + r[4] + r[8] - 1.0)));
    (void)printf(" after a rotation of %.1f degrees", acos(cosine) * (180.0 / 3.14159265358979));
  }
  (void)printf("\n%zu observed point%s", observed->count, observed->count == 1 ? "" : "s");
  if (best->residual_rms > 0.0) {
    (void)printf(", %.1f mm (RMS) from where the others put each", best->residual_rms);
  }
  (void)putchar('\n');
  for (size_t j = 0; j < observed->count; ++j) {
    const supine_locate_residual *r = &located->residuals[j];
    if (r->outlier) {
      (void)printf("%s does not fit and was left out: %.1f mm from where the others put it, %.1f "
                   "mm expected\n",
                   names->text[names->part[observed->points[j].vertex]], r->distance, r->sigma);
    }
  }
}

static supine_status locate(const request *wanted, const supine_basis *lungs,
                            const supine_basis *inside, const supine_command_names *names,
                            const supine_command_observed *observed, supine_error *error) {
  const size_t length = strlen(wanted->output);
  const bool csv = strcasecmp(wanted->output + length - 4, ".csv") == 0;
  const supine_basis *shown = csv ? inside : lungs;
  supine_command_located located = {0};
  const supine_locate_task task = {.inside = inside,
                                   .count = observed->count,
                                   .observed = observed->points,
                                   .state = wanted->state,
                                   .rigid = wanted->rigid};
  supine_status status =
      supine_command_located_find(&task, wanted->orientation.given, shown, &located, error);
  if (status == SUPINE_ERROR_ARGUMENT &&
      wanted->rigid) { /* the fault is in the file's points, not in an option */
    status = error->status = SUPINE_ERROR_FORMAT;
  }
  if (status == SUPINE_OK) {
    status = csv ? write_points(wanted->output, inside, names, &located, error)
                 : write_surface(wanted->output, lungs, &located, error);
  }
  if (status == SUPINE_OK) {
    tell(wanted, names, observed, shown, &located);
  }
  supine_command_located_free(&located);
  return status;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  supine_basis *lungs = NULL;
  supine_basis *inside = NULL;
  supine_command_names names = {0};
  supine_command_observed observed = {0};
  supine_status status = SUPINE_OK;
  if (wanted->orientation.given) {
    status = supine_options_gravity(&wanted->orientation, wanted->state.gravity, error);
  }
  if (status == SUPINE_OK) {
    status = supine_basis_open(given->operand[0], &lungs, error);
  }
  if (status == SUPINE_OK) {
    status = supine_command_inside_open(lungs, wanted->points, &inside, &names, error);
  }
  if (status == SUPINE_OK) {
    status = supine_command_observed_load(given->operand[1], inside, &names, wanted->noise,
                                          &observed, error);
  }
  if (status == SUPINE_OK) {
    status = locate(wanted, lungs, inside, &names, &observed, error);
  }
  supine_command_observed_free(&observed);
  supine_command_names_close(&names);
  supine_basis_close(inside);
  supine_basis_close(lungs);
  return status;
}

const supine_command supine_command_locate = {
    name,
    "find the whole lung from a few observed points",
    .usage = "BASIS OBSERVED.csv --points INSIDE [--posture NAME] [--volume VOLUME] -o FILE",
    .about = "Fits the lungs to a few points observed inside them, as a navigation system "
             "collects them: the volume, the translation between the frames, and the residual "
             "of the law near the points. OBSERVED.csv has the columns name,x,y,z, in mm, with "
             "the names given to 'supine embed'. Each position has its expected error.",
    .options = table,
    .notes =
        "The expected error is the root mean square of the distance in 3-D: half of all points "
        "lie within 0.9 times this distance, 95 % within 1.8 times. " SUPINE_EXPECTED_SUPPORT
        " A few points seldom determine the posture: give --posture. Without it six are "
        "tried, and the error includes the differences between them.\n"
        "\n"
        "Examples:\n"
        "  supine embed lungs.safetensors airways.csv -o inside.safetensors\n"
        "  supine locate lungs.safetensors observed.csv --points inside.safetensors --posture "
        "supine -o found.vtp\n"
        "  supine locate lungs.safetensors observed.csv --points inside.safetensors --posture "
        "left --volume rest --rigid -o found.csv",
    .operands_least = 2,
    .operands_most = 2,
    .operands_missing = "name a basis file and a CSV file of observed points",
    .request_size = sizeof(request),
    .run = run};
