/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine embed: make a basis of structures that move with the lungs. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "mesh/image/image.h"
#include "mesh/io/points.h"
#include "mesh/labels/shapes.h"
#include "precompute/inside/content.h"
#include "precompute/inside/embed.h"
#include "precompute/patient/patient_file.h"

#include "program/options/basis_input.h"
#include "program/options/command.h"
#include "program/options/surface_options.h"

static const char name[] = "embed";

/* A grid extends this far beyond the lungs, mm. Displacements fall to 0 over this distance. */
static const double margin = 60.0;

enum { LABELS_MOST = 64, NAME_MOST = 31 };

/* Labels given by --labels, and a name for each. */
typedef struct label_list {
  bool given;
  size_t count; /* number of labels; 0: all labels of the label map */
  unsigned label[LABELS_MOST];
  char name[LABELS_MOST][NAME_MOST + 7];
} label_list;

typedef struct request {
  const char *path;
  label_list labels;
  bool has_grid;
  double grid_spacing; /* mm */
  bool clamp;
  const char *rigid; /* names of rigid structures, or "all" */
  supine_mesh_load_options load;
} request;

/* Parse a list of labels, such as "all", "7" or "7=nodule,8=vessels". */
static supine_status read_labels(const char *text, void *field, supine_error *error) {
  label_list *list = field;
  (void)error;
  char item[40];
  list->given = true;
  list->count = 0;
  if (strcmp(text, "all") == 0) {
    return SUPINE_OK;
  }
  for (const char *at = text; supine_options_next_item(&at, item, sizeof item);) {
    const size_t digits = strspn(item, "0123456789");
    const bool named = item[digits] == '=' && item[digits + 1] != '\0';
    if (list->count == LABELS_MOST || digits == 0 || digits > 5 ||
        strlen(item + digits) > 1 + NAME_MOST || (item[digits] != '\0' && !named)) {
      return SUPINE_ERROR_ARGUMENT;
    }
    list->label[list->count] = (unsigned)strtoul(item, NULL, 10);
    (void)snprintf(list->name[list->count++], sizeof list->name[0], "%s%.31s",
                   named ? "" : "label ", named ? item + digits + 1 : item);
  }
  return SUPINE_OK;
}

static const supine_option table[] = {
    {"output", 'o', "FILE", "basis of the structures (.safetensors)", SUPINE_FILLS(request, path),
     .required = true, .file = SUPINE_FILE_OUT},
    {"grid", 0, "MM",
     "embed the nodes of a grid over the lungs, MM apart, for displacement fields. An image "
     "without --labels embeds a grid even without this option: nodes are centres of its voxels, "
     "and MM is rounded to a multiple of the distance between them",
     SUPINE_FILLS(request, grid_spacing), SUPINE_SAYS_GIVEN(request, has_grid), .standard = "4",
     SUPINE_ABOVE_ZERO, .wants = "millimetres"},
    {"labels", 0, "all|N[=NAME],...",
     "read images as label maps, and embed the surface of each label N as a part with this NAME; "
     "points and meshes may be embedded too",
     SUPINE_FILLS(request, labels), .read = read_labels,
     .wants =
         "all, or at most 64 labels with names of up to 31 letters, such as 7=nodule,8=vessels"},
    {"rigid", 0, "all|NAME,...",
     "parts that keep their size and shape and rotate with the tissue, such as nodules and "
     "tumours; other parts deform",
     SUPINE_FILLS(request, rigid)},
    {"clamp", 0, NULL,
     "move structures outside the lungs like the nearest point of the surface; by default the "
     "motion inside the lungs is extrapolated",
     SUPINE_FILLS(request, clamp)},
    {.table = supine_options_surface_frame, SUPINE_FILLS(request, load)},
    {.name = NULL}};

/* Make a grid of points: the voxels of the image `image_path` or, if it is NULL, equally spaced
 * nodes. */
static supine_status read_grid(const supine_inside_shells *shells, const request *wanted,
                               const char *image_path, supine_inside_content *content,
                               supine_error *error) {
  SUPINE_FREED_BY(supine_image_free) supine_image image = {0};
  if (image_path != NULL) {
    SUPINE_TRY(supine_image_read(image_path, &image, error));
  }
  return supine_inside_content_grid(shells, image_path != NULL ? &image : NULL,
                                    wanted->grid_spacing, margin, content, error);
}

static supine_status read_labelled(const request *wanted, const char *path,
                                   supine_inside_content *content, supine_error *error) {
  supine_labels_shape *parts = NULL;
  size_t count = 0;
  const label_list *list = &wanted->labels;
  supine_status status =
      supine_labels_shapes(path, list->label, list->count, &parts, &count, error);
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    char text[32];
    (void)snprintf(text, sizeof text, "label %u", parts[i].label);
    const char *part = list->count > 0 ? list->name[i] : text;
    if (parts[i].surface.triangle_count == 0) {
      supine_options_say(name, "%s: %s is left out, as it is thinner than half a voxel everywhere",
                         path, part);
      continue;
    }
    supine_options_say(name, "%s: %s, %.3g mL of voxels; its surface encloses %.3g mL", path, part,
                       parts[i].mask, 1e-3 * supine_mesh_volume(&parts[i].surface));
    status = supine_inside_content_surface(part, &parts[i].surface, content, error);
  }
  supine_labels_shapes_free(parts, count);
  return status;
}

static supine_status read_content(const supine_inside_shells *shells, const request *wanted,
                                  char **paths, size_t count, supine_inside_content *content,
                                  supine_error *error) {
  if (count == 0 || (!wanted->labels.given && supine_image_is_named(paths[0]))) {
    return read_grid(shells, wanted, count > 0 ? paths[0] : NULL, content, error);
  }
  for (size_t i = 0; i < count; ++i) {
    SUPINE_TRY(supine_image_is_named(paths[i]) ? read_labelled(wanted, paths[i], content, error)
               : supine_mesh_points_named(paths[i])
                   ? supine_inside_content_points(paths[i], &wanted->load, content, error)
                   : supine_inside_content_mesh(paths[i], &wanted->load, content, error));
  }
  return SUPINE_OK;
}

static void part_name(const supine_inside_content *content, size_t point, char *text, size_t size) {
  const char *at = content->names;
  for (uint32_t part = 0; part < content->part[point]; ++part) {
    at = strchr(at, '\n') + 1;
  }
  (void)snprintf(text, size, "%.*s", (int)strcspn(at, "\n"), at);
}

static void print_summary(const supine_inside_shells *shells, const supine_inside_content *content,
                          const supine_inside_report *report, const request *wanted) {
  const supine_basis_info *info = supine_basis_get_info(shells->basis);
  const bool grid = content->part_count == 0;
  (void)printf("%s: %zu %s", wanted->path, report->count,
               grid                          ? "nodes"
               : content->triangle_count > 0 ? "vertices and points"
                                             : "points");
  for (size_t lung = 0; lung < shells->count; ++lung) {
    (void)printf("%s%zu %s", lung == 0 ? ": " : ", ", report->in_lung[lung],
                 info->lung_names[lung]);
  }
  if (grid) {
    (void)printf("; grid of %zu x %zu x %zu", content->grid.size[0], content->grid.size[1],
                 content->grid.size[2]);
  }
  (void)printf("; %zu multiplications per vertex at run time\n", 3 * info->mode_count + 3);
  if (report->rigid > 0) {
    (void)printf("rigid parts, which move and rotate but keep their shape: %zu\n", report->rigid);
  }
  if (shells->scan.gains[0][0] != 0.0) {
    (void)puts("positions were given in the scan; the file holds them at full inflation");
  }
  if (report->outside > 0 && !grid) {
    char text[64];
    part_name(content, report->farthest, text, sizeof text);
    (void)printf("outside the lungs: %zu of %zu, by at most %.1f mm (%s); motion %s\n",
                 report->outside, report->count, report->farthest_mm, text,
                 wanted->clamp ? "taken from the nearest point of the surface"
                               : "extrapolated from inside (--clamp changes this)");
  }
}

/* Tell if the points lie inside the lungs only in other units or axes. Refuse points of which none
 * is inside as read if no unit was given. */
static supine_status check_content(const supine_inside_shells *shells, const request *wanted,
                                   const supine_inside_content *content, supine_error *error) {
  supine_inside_reading reading;
  char text[160];
  supine_status status = supine_inside_content_check_names(content, error);
  if (status != SUPINE_OK || content->part_count == 0) {
    return status;
  }
  supine_inside_shells_reading(shells, &wanted->load, content->points, content->count, &reading);
  if (reading.options[0] == '\0') {
    return SUPINE_OK;
  }
  (void)snprintf(text, sizeof text, "%zu of %zu points are inside the lungs, but %zu with %s",
                 reading.as_read, reading.tested, reading.inside, reading.options);
  if (reading.as_read == 0 && reading.tested > 2 && reading.other_units &&
      !(wanted->load.millimetres_per_unit > 0.0)) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "%s: give that, or --units mm to embed the points as they are", text);
  }
  supine_options_say(name, "warning: %s: check the axes and units of the points", text);
  return SUPINE_OK;
}

static supine_status embed(const supine_basis *basis, const request *wanted,
                           const supine_arguments *given, supine_error *error) {
  static supine_patient_record record; /* static, as it is too large for the stack */
  const char *law = supine_basis_metadata(basis, "patient_law");
  supine_inside_options options = {.clamp = wanted->clamp, .made_by = given->made_by};
  SUPINE_FREED_BY(supine_inside_shells_free) supine_inside_shells shells = {0};
  SUPINE_FREED_BY(supine_inside_content_free) supine_inside_content content = {0};
  supine_inside_report report;
  SUPINE_TRY(supine_inside_shells_create(basis, &shells, error));
  if (law != NULL && !supine_basis_get_info(basis)->vector) {
    SUPINE_TRY(supine_patient_decode(given->operand[0], law, &record, error));
    options.context = &record;
    options.field = record.path_span[0] != 0.0 ? supine_patient_field : NULL;
  }
  SUPINE_TRY(read_content(&shells, wanted, given->operand + 1, given->count - 1, &content, error));
  SUPINE_TRY(check_content(&shells, wanted, &content, error));
  if (wanted->rigid != NULL) {
    SUPINE_TRY(supine_inside_content_make_rigid(&content, wanted->rigid, error));
  }
  SUPINE_TRY(supine_inside_embed(&shells, &content, &options, wanted->path, &report, error));
  print_summary(&shells, &content, &report, wanted);
  return SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  const request *wanted = chosen;
  const bool labels = wanted->labels.given;
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *basis = NULL;
  bool image = false;
  for (size_t i = 1; i < given->count; ++i) {
    image = image || supine_image_is_named(given->operand[i]);
  }
  if (given->count == 1 && !wanted->has_grid) {
    return supine_error_set(
        error, SUPINE_ERROR_ARGUMENT,
        "nothing to embed: give points (.csv, .mrk.json), meshes or an image, or --grid MM");
  }
  if (labels && (!image || wanted->has_grid)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            image ? "--labels embeds surfaces, --grid embeds nodes: give only one"
                                  : "--labels needs a label map: name one (.nrrd, .nii, .nii.gz)");
  }
  if (!labels && given->count > 1 && (image ? given->count > 2 : wanted->has_grid)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "a grid or an image cannot be embedded with other content: embed it "
                            "alone, or give --labels to embed the parts of a label map");
  }
  SUPINE_TRY(supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, &basis, error));
  return embed(basis, wanted, given, error);
}

const supine_command supine_command_embed = {
    name,
    "make points, meshes or a grid move with the lungs",
    .usage = "BASIS CONTENT... -o FILE\n"
             "BASIS --grid MM -o FILE",
    .about = "Makes a basis of structures that move with the lungs of BASIS: points (.mrk.json of "
             "3D Slicer, or CSV with the columns x, y, z and name), meshes (airways, vessels, "
             "nodules), the parts of a label map, or the nodes of a grid, which may be that of an "
             "image (.nrrd, .nii, .nii.gz). 'supine deform', 'breathe', 'compare', 'info' and "
             "'stream' read the file like any basis; 'render' and 'export' show it with "
             "--inside.\n"
             "\n"
             "Displacements inside are interpolated from the displacements of each lung's surface "
             "by biharmonic splines, which are exact on the surface and for affine motion.",
    .options = table,
    .notes = "Examples:\n"
             "  supine embed lungs.safetensors nodules.csv airways.ply -o inside.safetensors\n"
             "  supine deform inside.safetensors --posture prone -o prone.csv\n"
             "  supine embed lungs.safetensors labels.nii.gz --labels 7=nodule --rigid nodule -o "
             "inside.safetensors\n"
             "  supine embed lungs.safetensors ct.nii.gz -o grid.safetensors\n"
             "  supine deform grid.safetensors --posture prone --image ct.nii.gz -o prone.nii.gz",
    .operands_least = 1,
    .operands_most = SIZE_MAX,
    .operands_missing = "name a basis file (made by 'supine precompute'), then what to embed",
    .request_size = sizeof(request),
    .run = run};
