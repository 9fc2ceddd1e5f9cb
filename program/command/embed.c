/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine embed: make a basis of structures that move with the lungs. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "mesh/image/image.h"
#include "precompute/inside/embed.h"
#include "precompute/lobes.h"
#include "precompute/patient/patient_file.h"

#include "program/command/embed_content.h"
#include "program/command/list.h"
#include "program/options/basis_input.h"
#include "program/options/surface_options.h"

static const char name[] = "embed";

typedef struct request {
  const char *path;
  supine_embed_content content;
  bool clamp;
  const char *rigid; /* names of rigid structures, or "all" */
} request;

/* Parse a list of labels, such as "all", "7" or "7=nodule,8=vessels". */
static supine_status read_labels(const char *text, void *field, supine_error *error) {
  supine_embed_labels *list = field;
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
    if (list->count == SUPINE_EMBED_LABELS_MOST || digits == 0 || digits > 5 ||
        strlen(item + digits) > 1 + SUPINE_EMBED_NAME_MOST || (item[digits] != '\0' && !named)) {
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
     "continued beyond its border, and MM is rounded to a multiple of the distance between them. "
     "The grid reaches 60 mm past the lungs, or 1.5 times their largest displacement",
     SUPINE_FILLS(request, content.grid_spacing), SUPINE_SAYS_GIVEN(request, content.has_grid),
     .standard = "4", SUPINE_ABOVE_ZERO, SUPINE_MEASURES(LENGTH)},
    {"labels", 0, "all|N[=NAME],...",
     "read images as label maps, and embed the surface of each label N as a part with this NAME; "
     "all of several maps, or of the folder of masks that TotalSegmentator writes (its lobes), "
     "have the names of the files. Points and meshes may be embedded too",
     SUPINE_FILLS(request, content.labels), .read = read_labels,
     .wants =
         "all, or at most 64 labels with names of up to 31 letters, such as 7=nodule,8=vessels"},
    {"rigid", 0, "all|NAME,...",
     "further parts that keep their size and shape and rotate with the tissue. Compact components "
     "of a part, of 1 to 30 mL, such as nodules and tumours, always do; others deform",
     SUPINE_FILLS(request, rigid)},
    {"clamp", 0, NULL,
     "move structures outside the lungs like the nearest point of the surface; by default the "
     "motion inside the lungs is extrapolated",
     SUPINE_FILLS(request, clamp)},
    {.table = supine_options_surface_frame, SUPINE_FILLS(request, content.load)},
    {.name = NULL}};

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
  const char *what = report->count == 1 ? "point" : "points";
  if (grid) {
    what = "nodes";
  } else if (content->triangle_count > 0) {
    what = "vertices and points";
  }
  supine_options_line("%s: %zu %s", wanted->path, report->count, what);
  for (size_t lung = 0; lung < shells->count; ++lung) {
    supine_options_line("%s%zu %s", lung == 0 ? ": " : ", ", report->in_lung[lung],
                        info->lung_names[lung]);
  }
  if (grid) {
    supine_options_line("; grid of %zu x %zu x %zu", content->grid.size[0], content->grid.size[1],
                        content->grid.size[2]);
  }
  supine_options_line("; %zu multiplications per vertex at run time\n", 3 * info->mode_count + 3);
  if (report->rigid > 0) {
    supine_options_line("rigid parts, which move and rotate but keep their shape: %zu\n",
                        report->rigid);
  }
  if (shells->scan.gains[0][0] != 0.0) {
    supine_options_line(
        "positions were given in the scan; the file holds them at full inflation\n");
  }
  if (report->outside > 0 && !grid) {
    char text[64];
    part_name(content, report->farthest, text, sizeof text);
    supine_options_line("outside the lungs: %zu of %zu, by at most %.1f mm (%s); motion %s\n",
                        report->outside, report->count, report->farthest_mm, text,
                        wanted->clamp ? "taken from the nearest point of the surface"
                                      : "extrapolated from inside (--clamp changes this)");
  }
}

/* Return what --json prints: what was embedded, and how much of it lies outside the lungs. */
static json_t *list_summary(const supine_inside_shells *shells, const supine_inside_report *report,
                            const request *wanted) {
  const supine_basis_info *info = supine_basis_get_info(shells->basis);
  json_t *lungs = json_object();
  for (size_t lung = 0; lung < shells->count; ++lung) {
    (void)json_object_set_new(lungs, info->lung_names[lung],
                              json_integer((json_int_t)report->in_lung[lung]));
  }
  return json_pack("{s:o, s:I, s:o, s:I, s:I, s:f}", "file", supine_options_json_text(wanted->path),
                   "points", (json_int_t)report->count, "points_in_lung", lungs, "rigid_parts",
                   (json_int_t)report->rigid, "outside", (json_int_t)report->outside,
                   "farthest_outside_mm", report->farthest_mm);
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
    options.field = record.in_basis ? supine_patient_field : NULL;
  }
  SUPINE_TRY(supine_command_embed_read(&shells, &wanted->content, given->operand + 1,
                                       given->count - 1, &content, error));
  SUPINE_TRY(supine_inside_content_find_compact(&content, error));
  if (wanted->rigid != NULL) {
    SUPINE_TRY(supine_inside_content_make_rigid(&content, wanted->rigid, error));
  }
  SUPINE_TRY(supine_inside_embed(&shells, &content, &options, wanted->path, &report, error));
  supine_options_say_findings(name, &report.findings);
  print_summary(&shells, &content, &report, wanted);
  SUPINE_ADD_RESULT(list_summary(&shells, &report, wanted));
  return SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  const request *wanted = chosen;
  const bool labels = wanted->content.labels.given;
  SUPINE_FREED_BY(supine_options_basis_close) supine_basis *basis = NULL;
  bool image = false;
  for (size_t i = 1; i < given->count; ++i) {
    const bool folder = supine_precompute_is_folder(given->operand[i]);
    SUPINE_REFUSE_IF(folder && !labels, error, SUPINE_ERROR_ARGUMENT,
                     "%s is a folder: give --labels all to embed the masks of lobes in it",
                     given->operand[i]);
    image = image || folder || supine_image_is_named(given->operand[i]);
  }
  SUPINE_REFUSE_IF(
      given->count == 1 && !wanted->content.has_grid, error, SUPINE_ERROR_ARGUMENT,
      "nothing to embed: give points (.csv, .fcsv, .mrk.json), meshes or an image, or --grid MM");
  SUPINE_REFUSE_IF(
      labels && (!image || wanted->content.has_grid), error, SUPINE_ERROR_ARGUMENT,
      image ? "--labels embeds surfaces, --grid embeds nodes: give only one"
            : "--labels needs a label map: name one (.nrrd, .nii, .nii.gz), or the folder "
              "of masks that TotalSegmentator writes");
  SUPINE_REFUSE_IF(!labels && given->count > 1 &&
                       (image ? given->count > 2 : wanted->content.has_grid),
                   error, SUPINE_ERROR_ARGUMENT,
                   "a grid or an image cannot be embedded with other content: embed it alone, or "
                   "give --labels to embed the parts of a label map");
  SUPINE_TRY(
      supine_options_basis_open(given->operand[0], SUPINE_STORAGE_AUTO, false, &basis, error));
  return embed(basis, wanted, given, error);
}

const supine_command supine_command_embed = {
    name,
    "make points, meshes or a grid move with the lungs",
    .usage = "BASIS CONTENT... -o FILE\n"
             "BASIS --grid MM -o FILE",
    .about =
        "Makes nodules, airways and images move with the lungs of BASIS: points (.mrk.json or "
        ".fcsv of 3D Slicer, or CSV with the columns x, y, z and name), meshes (airways, vessels, "
        "nodules), the parts of a label map, or the nodes of a grid, which may be that of an image "
        "(.nrrd, .nii, .nii.gz). The file is a basis: 'supine deform', 'breathe', 'compare', "
        "'info' and 'stream' read it; 'render' and 'export' show it with --inside.\n"
        "\n"
        "Displacements inside are interpolated from the displacements of each lung's surface by "
        "biharmonic splines, which are exact on the surface and for affine motion.\n"
        "\n"
        "Parts that are open surfaces, or as long as a ball of a fifth of a lung, such as airways, "
        "vessels and lobes, are marked as anatomy; all others are targets.",
    .options = table,
    .notes = "A file nodules.csv, in mm:\n"
             "  name,x,y,z\n"
             "  nodule,-80,-120,-90\n"
             "\n"
             "Examples:\n"
             "  supine embed lungs.safetensors nodules.csv airways.ply -o inside.safetensors\n"
             "  supine export lungs.safetensors --inside inside.safetensors -o lungs.html\n"
             "  supine deform inside.safetensors --posture prone -o prone.csv\n"
             "  supine embed lungs.safetensors labels.nii.gz --labels 7=nodule --rigid nodule -o "
             "inside.safetensors\n"
             "  supine embed lungs.safetensors ct.nii.gz -o grid.safetensors\n"
             "  supine deform grid.safetensors --posture prone --image ct.nii.gz -o prone.nii.gz",
    .operands_least = 1,
    .operands_most = SIZE_MAX,
    .operands_missing = "name a basis file (made by 'supine precompute'), then what to embed",
    .request_size = sizeof(request),
    .uses_blas = true,
    .run = run};
