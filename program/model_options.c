/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The options that choose the lungs and the model. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sh/base/parallel.h"
#include "sh/base/text.h"

#include "precompute/inside/surface.h"
#include "precompute/lungs/gate.h"
#include "program/model_options.h"
#include "program/options/posture_list.h"
#include "program/options/surface_options.h"

void supine_command_model_options_begin(supine_model_options *options) {
  options->model = supine_physics_model(SUPINE_LAW_PAPER);
  options->law_choice = SUPINE_LAW_COUNT;
  options->resting = supine_reference_resting_default();
  options->model.reach = options->model.force.base = options->model.force.gain = NAN;
  options->model.force.box[0] = options->model.direction.c[0] = NAN;
}

/* Select the law; explicit options override its constants. Breaths of `paper` are added to the scan
 * as it is, which has no other state then. */
static int choose_law(supine_model_options *options, const char *command) {
  if (options->law_choice == SUPINE_LAW_COUNT) {
    options->law_choice = options->has_scan && options->scan.kind == SUPINE_SCAN_NONE
                              ? SUPINE_LAW_PAPER
                              : SUPINE_LAW_DEEP;
  }
  if (!options->has_scan && options->law_choice != SUPINE_LAW_PAPER) {
    options->scan.kind = SUPINE_SCAN_FULL;
  }
  if (options->law_choice == SUPINE_LAW_PAPER && options->scan.kind != SUPINE_SCAN_NONE) {
    return supine_options_usage(command, "--law paper adds breaths to the scan as it is: leave "
                                         "--scanned out, or take --law deep");
  }
  const supine_model law = supine_physics_model((supine_law)options->law_choice);
  supine_model *model = &options->model;
  model->law = law.law;
  model->force.pair = law.force.pair;
  model->reach = isnan(model->reach) ? law.reach : model->reach;
  model->force.base = isnan(model->force.base) ? law.force.base : model->force.base;
  model->force.gain = isnan(model->force.gain) ? law.force.gain : model->force.gain;
  if (isnan(model->force.box[0])) {
    memcpy(model->force.box, law.force.box, sizeof law.force.box);
  }
  if (isnan(model->direction.c[0])) {
    memcpy(model->direction.c, law.direction.c, sizeof law.direction.c);
  }
  return SUPINE_EXIT_OK;
}

/* A law's name; those of former versions answer with what took their place. */
static int read_law(const char *command, const char *text, void *field) {
  int *choice = field;
  for (int law = 0; law < SUPINE_LAW_COUNT; ++law) {
    if (strcasecmp(text, supine_physics_law_names[law]) == 0) {
      *choice = law;
      return SUPINE_EXIT_OK;
    }
  }
  if (strcasecmp(text, "tidal") == 0 || strcasecmp(text, "cohort") == 0) {
    return supine_options_usage(command,
                                "--law %s is no more: 'deep', the default, takes its place, for "
                                "scans at rest too. Leave --law out and say what the scan shows, "
                                "as --scanned supine:rest",
                                text);
  }
  return SUPINE_OPTION_MISFIT;
}

/* "supine:rest", "prone:-3000", "full", "none" */
static int read_scan(const char *command, const char *text, void *field) {
  supine_model_options *options = field;
  supine_scan *scan = &options->scan;
  const char *colon = strrchr(text, ':');
  const char *state = colon == NULL ? text : colon + 1;
  options->has_scan = true;
  if (colon != NULL) {
    char posture[SUPINE_POSTURE_NAME_MAX];
    supine_posture_list one;
    (void)snprintf(posture, sizeof posture, "%.*s", (int)(colon - text), text);
    const int result = supine_options_posture_list_parse(command, posture, &one);
    if (result != SUPINE_EXIT_OK) {
      return result;
    }
    memcpy(scan->gravity, one.item[0].gravity, sizeof scan->gravity);
  }
  scan->kind = strcmp(state, "none") == 0   ? SUPINE_SCAN_NONE
               : strcmp(state, "full") == 0 ? SUPINE_SCAN_FULL
               : strcmp(state, "rest") == 0 ? SUPINE_SCAN_REST
                                            : SUPINE_SCAN_VOLUME;
  if (scan->kind == SUPINE_SCAN_VOLUME &&
      !(supine_options_parse_number(state, &scan->volume) && scan->volume <= 0.0)) {
    return SUPINE_OPTION_MISFIT;
  }
  /* only what is not full needs to say in which posture */
  return supine_options_fits(colon != NULL || scan->kind <= SUPINE_SCAN_FULL);
}

/* "supine=0.43,prone=0.47"; anything without an equals sign names a file. */
static int read_resting(const char *command, const char *text, void *field) {
  supine_model_options *options = field;
  supine_error error;
  char copy[256];
  (void)snprintf(copy, sizeof copy, "%s", text);
  if (strchr(text, '=') == NULL) {
    return supine_reference_resting_load(text, &options->resting, &error) == SUPINE_OK
               ? SUPINE_EXIT_OK
               : supine_options_fail(command, &error);
  }
  for (char *rest = copy, *piece; (piece = strsep(&rest, ",")) != NULL;) {
    char *value = strchr(piece, '=');
    double share = 0.0;
    if (value == NULL || !supine_options_parse_number(value + 1, &share)) {
      return SUPINE_OPTION_MISFIT;
    }
    *value = '\0';
    if (supine_reference_resting_set(&options->resting, piece, share, &error) != SUPINE_OK) {
      return supine_options_usage(command, "--resting: %s", error.message);
    }
  }
  return SUPINE_EXIT_OK;
}

/* A model's name; anything with a dot or a slash is a file of vectors. */
static int read_direction(const char *command, const char *text, void *field) {
  supine_model_options *options = field;
  (void)command;
  static const char *const names[] = {"box", "normal", "radial"};
  options->direction = NULL;
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    if (strcmp(text, names[i]) == 0) {
      options->model.direction.model = (supine_direction_model)i;
      return SUPINE_EXIT_OK;
    }
  }
  options->model.direction.model = SUPINE_DIRECTION_VECTORS;
  options->direction = text;
  return supine_options_fits(strpbrk(text, "./") != NULL);
}

/* "linear:z:0.5:1.5"; anything without such a beginning names a file. */
static int read_expandability(const char *command, const char *text, void *field) {
  supine_model_options *options = field;
  (void)command;
  options->expandability = NULL;
  options->law = (supine_expandability_law){0};
  if (strcmp(text, "uniform") == 0) {
    return SUPINE_EXIT_OK;
  }
  if (strncmp(text, "linear:", strlen("linear:")) == 0) {
    options->law.shape = SUPINE_EXPANDABILITY_LINEAR;
  } else if (strncmp(text, "exp:", strlen("exp:")) == 0) {
    options->law.shape = SUPINE_EXPANDABILITY_EXPONENTIAL;
  } else {
    options->expandability = text;
    return SUPINE_EXIT_OK;
  }
  const char *at = strchr(text, ':') + 1;
  if (at[0] < 'x' || at[0] > 'z' || at[1] != ':') {
    return SUPINE_OPTION_MISFIT;
  }
  options->law.axis = at[0] - 'x';
  char numbers[128];
  (void)snprintf(numbers, sizeof numbers, "%s", at + 2);
  char *colon = strchr(numbers, ':');
  if (colon == NULL) {
    return SUPINE_OPTION_MISFIT;
  }
  *colon = '\0';
  return supine_options_fits(supine_options_parse_number(numbers, &options->law.from) &&
                             supine_options_parse_number(colon + 1, &options->law.to) &&
                             options->law.from > 0.0 && options->law.to > 0.0);
}

static int read_lesion(const char *command, const char *text, void *field) {
  supine_model_options *options = field;
  (void)command;
  double v[5];
  if (options->lesion_count == MODEL_LESIONS_MAX || !supine_options_parse_numbers(text, 5, v) ||
      !(v[3] > 0.0) || !(v[4] > 0.0)) {
    return SUPINE_OPTION_MISFIT;
  }
  options->lesions[options->lesion_count++] = (supine_lesion){{v[0], v[1], v[2]}, v[3], v[4]};
  return SUPINE_EXIT_OK;
}

/* "left:0.3" */
static int read_lung(const char *command, const char *text, void *field) {
  supine_model_options *options = field;
  (void)command;
  const char *colon = strchr(text, ':');
  const bool left = colon == text + 4 && strncmp(text, "left", 4) == 0;
  const bool right = colon == text + 5 && strncmp(text, "right", 5) == 0;
  double share;
  if (!(left || right) || !supine_options_parse_number(colon + 1, &share) ||
      !(share > 0.0 && share <= 1.0)) {
    return SUPINE_OPTION_MISFIT;
  }
  *(left ? &options->left_share : &options->right_share) = share;
  return SUPINE_EXIT_OK;
}

/* The laws' help, and the constants of each for the options that change one. */
#define LAW_HELP(id, name, base, gain, box, constants, reach, pair, what) name ": " what "\n"
#define LAW_BASE(id, name, base, ...) " " name " " #base
#define LAW_GAIN(id, name, base, gain, ...) " " name " " #gain
#define LAW_BOX(id, name, base, gain, box, ...) " " name " " #box
#define LAW_CONSTANTS(id, name, base, gain, box, constants, ...) " " name " " #constants

#define FILLS(member) SUPINE_FILLS(supine_model_options, member)

const supine_option supine_command_model_options[] = {
    {.help = "Surfaces:"},
    {.table = supine_options_surface_frame, FILLS(load)},
    {"midline", 0, "X",
     "x of the sagittal plane between the lungs, mm; default: the middle of the box of two lungs, "
     "the inner face of a single lung's",
     FILLS(midline), SUPINE_SAYS_GIVEN(supine_model_options, has_midline), .wants = "an x in mm"},
    {.table = supine_command_label_options, FILLS(maps)},
    {.help = "The scan and the law:"},
    {"scanned", 0, "POSTURE:STATE",
     "what the surfaces show: full (a breath-hold at full inflation, the default; then the posture "
     "does not matter), POSTURE:rest (the end of a quiet expiration), POSTURE:ML (mL relative to "
     "full, as supine:-3000), or none (nothing is known: breaths are added to the scan, and "
     "turning "
     "alone moves nothing). Lungs have one shape at full inflation in every posture, and all that "
     "gravity does is below it; from a scan in another state that shape is found first",
     .read = read_scan,
     .wants = "full, none, POSTURE:rest or POSTURE:ML with ML at most 0, as supine:-3000"},
    {"law", 0, "LAW", SUPINE_LAWS(LAW_HELP) "The options below change single constants of it",
     FILLS(law_choice), .read = read_law, .choices = supine_physics_law_names},
    {"resting", 0, "LIST|FILE",
     "volume at rest as a share of the full one, by posture; default "
     "left, right and prone 0.47, supine and inverted 0.43, upright 0.53. Name those that "
     "differ, or a CSV file with the columns posture,share",
     .read = read_resting, .file = SUPINE_FILE_NONE,
     .wants = "POSTURE=SHARE,... or a CSV file with the columns posture,share"},
    {.help = "Force on a vertex, f = base + gain h + cx X + cy Y + cz Z, with h its height along "
             "gravity (0 uppermost, 1 lowermost) and X, Y, Z its place in the box (from the "
             "midline outwards, from the back, from the apex; 0 to 1):"},
    {"base", 0, "B", "default by the law:" SUPINE_LAWS(LAW_BASE), FILLS(model.force.base)},
    {"gain", 0, "G", "default:" SUPINE_LAWS(LAW_GAIN), FILLS(model.force.gain)},
    {"box-force", 0, "X,Y,Z", "cx, cy, cz: fixed to the body; default:" SUPINE_LAWS(LAW_BOX),
     FILLS(model.force.box), .wants = "three numbers, CX,CY,CZ"},
    {"soften", 0, "S",
     "dependent tissue is more expandable: a exp(S (h - mean)), h its height along gravity, 0 to "
     "1; "
     "default 0. Needs a reach",
     FILLS(model.force.soften)},
    {.help = "Direction of displacement:"},
    {"direction", 0, "WHAT",
     "box (default): (+-c1 X^c2, -c3 Y^c4, -c5 Z^c6) mm; normal; radial\n"
     "FILE: any vectors: CSV with the columns dx,dy,dz, mm, a row a vertex in the order that "
     "'supine solve' writes",
     .read = read_direction, .wants = "box, normal, radial or a CSV file of vectors",
     .file = SUPINE_FILE_IN},
    {"constants", 0, "C1,...,C6",
     "of the box model; default:" SUPINE_LAWS(
         LAW_CONSTANTS) ". Fits to landmarks: paper's of ten 4-D CTs (DIR-Lab), deep's of ten full "
                        "breaths (DIR-Lab COPDgene). The paper's own are lost",
     FILLS(model.direction.c), .wants = "six numbers, C1,C2,C3,C4,C5,C6"},
    {.help = "Tissue. Expandability a is how readily a part gives way; stiffness is E = 1/a. Only "
             "ratios count: a = 2 beside a = 1 is twice as expandable, doubling all of them "
             "changes nothing."},
    {"expandability", 0, "WHAT",
     "uniform (default)\n"
     "linear:AXIS:FROM:TO, exp:AXIS:FROM:TO: a goes from FROM to TO in a straight line, or by "
     "equal ratios, along AXIS: x from the midline outwards, y from the back to the front, z from "
     "the apex to the base; linear:z:0.5:1.5 expands most at the base\n"
     "FILE: a of every vertex, CSV: a header line, then one value a line in the order of the "
     "vertices (left lung first, each as its file first names them: the order that 'supine solve' "
     "writes), or vertex,value counted from 0\n"
     "ply:PROPERTY: a of every vertex, from a property of that name of the vertices of the "
     "surfaces themselves, all of them PLY files",
     .read = read_expandability, .file = SUPINE_FILE_IN,
     .wants = "uniform, linear:AXIS:FROM:TO or exp:AXIS:FROM:TO with AXIS x, y or z and both ends "
              "above 0, ply:PROPERTY, or a file"},
    {"lesion", 0, "X,Y,Z,RADIUS,FACTOR",
     "a tumour at X,Y,Z (mm, LPS) multiplies E by FACTOR up to half of RADIUS (mm), less and less "
     "from there, and not at all from RADIUS on. Above 1 stiffens: it moves less; 1 changes "
     "nothing. May be repeated",
     .read = read_lesion, .wants = "(at most 64) X,Y,Z,RADIUS,FACTOR, the last two above 0"},
    {"lung", 0, "SIDE:SHARE",
     "left or right lung collapsed (pneumothorax): its resting volume, and what it takes of a "
     "breath, are SHARE (0 to 1) of what they were; a breath's volume stays exact, the other lung "
     "takes the rest",
     .read = read_lung, .wants = "left:SHARE or right:SHARE, above 0 and at most 1"},
    {"reach", 0, "MM",
     "forces spread over this length along the surface, whatever the mesh (about exp(-r/MM)); "
     "default: 10; paper: over a few links, so that a finer mesh spreads less and "
     "may look torn",
     FILLS(model.reach), SUPINE_ABOVE_ZERO, .wants = "a length in mm above 0"},
    {.name = NULL}};

typedef struct load_work {
  const supine_mesh_load_options *options;
  char **paths;
  supine_mesh *meshes;
  supine_mesh_report *reports;
  supine_axes axes;     /* of the files' coordinates, or of a map's header */
  supine_error *errors; /* status SUPINE_OK where loading went well */
} load_work;

static void load_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const load_work *work = context;
  for (size_t i = begin; i < end; ++i) {
    work->errors[i].status = supine_mesh_load(work->paths[i], work->options, &work->meshes[i],
                                              &work->reports[i], &work->errors[i]);
  }
}

/* What reading a file found. */
static void find(const char *path, const supine_mesh_report *report, supine_findings *findings) {
  if (report->degenerate_faces > 0 || report->unreferenced_vertices > 0) {
    supine_findings_add(
        findings, "%s: note: dropped %zu degenerate face%s and %zu unreferenced vert%s", path,
        report->degenerate_faces, report->degenerate_faces == 1 ? "" : "s",
        report->unreferenced_vertices, report->unreferenced_vertices == 1 ? "ex" : "ices");
  }
  if (report->comment_names_ras) {
    supine_findings_add(findings,
                        "%s: note: read as LPS, but its comment mentions RAS: if its x points to "
                        "the right, add --axes RAS",
                        path);
  }
}

static const char ply_prefix[] = "ply:";

/* From the files themselves: each has some of the vertices. */
static supine_status load_ply(const supine_model_options *options, const load_work *work,
                              size_t count, const supine_lungs *lungs, double *a,
                              supine_error *error) {
  const char *property = options->expandability + strlen(ply_prefix);
  supine_status status = SUPINE_OK;
  memset(a, 0, lungs->mesh.vertex_count * sizeof *a);
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    status =
        supine_tissue_expandability_load_ply(work->paths[i], property, work->reports[i].axes,
                                             options->load.millimetres_per_unit, lungs, a, error);
  }
  return status;
}

static supine_status set_expandability(supine_model_options *options, const load_work *work,
                                       size_t count, const supine_lungs *lungs,
                                       supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  if (options->expandability == NULL && options->law.shape == SUPINE_EXPANDABILITY_UNIFORM) {
    return SUPINE_OK;
  }
  options->stiffness = malloc(n * sizeof *options->stiffness);
  double *a = options->stiffness;
  if (a == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  options->model.stiffness = a;
  supine_status status = SUPINE_OK;
  if (options->expandability == NULL) {
    status = supine_tissue_expandability_regional(lungs, &options->law, a, error);
  } else if (strncmp(options->expandability, ply_prefix, strlen(ply_prefix)) == 0) {
    status = load_ply(options, work, count, lungs, a, error);
  } else {
    status = supine_tissue_expandability_load(options->expandability, n, a, error);
  }
  if (status == SUPINE_OK) {
    status = supine_tissue_expandability_stiffness(n, a, a, error);
  }
  return status;
}

static supine_status set_directions(supine_model_options *options, const supine_lungs *lungs,
                                    supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  if (options->direction == NULL) {
    return SUPINE_OK;
  }
  options->vectors = malloc(3 * n * sizeof *options->vectors);
  if (options->vectors == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  options->model.direction.vectors = options->vectors;
  return supine_physics_directions_load(options->direction, n, options->vectors, error);
}

/* Why a lesion changes nothing: stiffness is the surface's, and it reaches none of it. */
static void mention_lesion(const char *command, const supine_lungs *lungs,
                           const supine_lesion *lesion) {
  supine_inside_surface *surface = NULL;
  const double *c = lesion->centre;
  if (supine_inside_surface_create(lungs->mesh.vertices, lungs->mesh.triangle_count,
                                   lungs->mesh.triangles, &surface, NULL) != SUPINE_OK) {
    return;
  }
  const supine_inside_place place = supine_inside_surface_find(surface, c, NULL);
  supine_options_say(command,
                     "warning: the lesion at %g,%g,%g is %s the lungs, %.0f mm from their surface: "
                     "with a radius of %g mm it reaches none of it and changes nothing%s",
                     c[0], c[1], c[2], place.depth > 0.0 ? "inside" : "outside", fabs(place.depth),
                     lesion->radius, place.depth > 0.0 ? "; a larger RADIUS would" : "");
  supine_inside_surface_destroy(surface);
}

static supine_status set_lesions(supine_model_options *options, const char *command,
                                 const supine_lungs *lungs, supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  if (options->lesion_count == 0) {
    return SUPINE_OK;
  }
  options->factors = malloc(n * sizeof *options->factors);
  if (options->factors == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  for (size_t i = 0; i < n; ++i) {
    options->factors[i] = 1.0;
  }
  options->model.lesions = options->factors;
  for (size_t l = 0; l < options->lesion_count; ++l) {
    const supine_lesion *lesion = &options->lesions[l];
    size_t reached = 0;
    const supine_status status =
        supine_tissue_add_lesion(lungs, lesion, options->factors, &reached, error);
    if (status != SUPINE_OK) {
      return status;
    }
    if (reached == 0) {
      mention_lesion(command, lungs, lesion);
    }
  }
  return SUPINE_OK;
}

static supine_status set_shares(supine_model_options *options, const supine_lungs *lungs,
                                supine_error *error) {
  static const char *const names[] = {"left", "right"};
  const double shares[] = {options->left_share, options->right_share};
  for (size_t side = 0; side < 2; ++side) {
    size_t lung = 0;
    while (lung < lungs->lung_count && lungs->side[lung] != (side == 0 ? 1 : -1)) {
      ++lung;
    }
    if (shares[side] == 0.0) {
      continue;
    }
    if (lung == lungs->lung_count) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "--lung %s: the model has no %s lung",
                              names[side], names[side]);
    }
    const supine_status status =
        supine_tissue_collapse(lungs, lung, shares[side], options->model.share, error);
    if (status != SUPINE_OK) {
      return status;
    }
  }
  return SUPINE_OK;
}

void supine_command_model_options_free(supine_model_options *options) {
  free(options->stiffness);
  free(options->vectors);
  free(options->factors);
  options->stiffness = NULL;
  options->vectors = NULL;
  options->factors = NULL;
  options->model.direction.vectors = NULL;
  options->model.stiffness = NULL;
  options->model.lesions = NULL;
}

/* The frame that all files share. */
static supine_scan_frame frame_of(const supine_model_options *options,
                                  const supine_mesh_report *reports, size_t count) {
  for (size_t i = 1; i < count; ++i) {
    if (reports[i].axes != reports[0].axes) {
      return (supine_scan_frame){0};
    }
  }
  const double unit = options->load.millimetres_per_unit;
  return (supine_scan_frame){reports[0].axes, unit == 0.0 ? 1.0 : unit};
}

/* What was assumed of the scan, in one line that the user can check. */
static void say_assumed(supine_model_options *options, const supine_lungs *lungs,
                        const supine_mesh_report *report) {
  const supine_reference *reference = &options->reference;
  const size_t size = sizeof options->assumed;
  char *text = options->assumed;
  char letters[4];
  supine_mesh_axes_letters(report->axes, letters);
  text[0] = '\0';
  supine_text_add(text, size, "%s axes (%s), %g mm a unit", letters,
                  options->load.axes != SUPINE_AXES_AUTO ? "as told"
                  : report->axes_from_tag                ? "the file's tag"
                                                         : "assumed",
                  options->load.millimetres_per_unit == 0.0 ? 1.0
                                                            : options->load.millimetres_per_unit);
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    supine_text_add(text, size, "; %s lung in", supine_lungs_name(lungs, lung));
    for (size_t axis = 0; axis < 3; ++axis) {
      double low = INFINITY;
      double high = -INFINITY;
      for (size_t i = lungs->lung_begin[lung]; i < lungs->lung_begin[lung + 1]; ++i) {
        low = fmin(low, lungs->mesh.vertices[3 * i + axis]);
        high = fmax(high, lungs->mesh.vertices[3 * i + axis]);
      }
      supine_text_add(text, size, "%s %c %.0f to %.0f", axis == 0 ? "" : ",", "xyz"[axis], low,
                      high);
    }
    supine_text_add(text, size, " mm");
  }
  supine_text_add(text, size, "; %s law; scan ",
                  options->patient != NULL ? "the patient's own"
                                           : supine_physics_law_names[options->model.law]);
  if (!reference->known) {
    supine_text_add(text, size, "taken as the reference of every posture");
    return;
  }
  if (reference->scan.kind == SUPINE_SCAN_FULL) {
    supine_text_add(text, size, "at full inflation, %.0f mL", reference->full_volume);
  } else {
    const double *g = reference->scan.gravity;
    supine_text_add(text, size, "%s%.0f mL below full (%.0f mL), gravity along %.3g,%.3g,%.3g",
                    reference->scan.kind == SUPINE_SCAN_REST ? "at rest, " : "",
                    -reference->scan_volume, reference->full_volume, g[0], g[1], g[2]);
  }
  static const double supine[3] = {0.0, 1.0, 0.0};
  const double share = supine_reference_along_axes(reference->resting.share, supine);
  supine_text_add(text, size, "; rest supine %.0f mL", share * reference->full_volume);
}

/* Surfaces from files, all at once; an exit code. */
static int load_meshes(const char *command, load_work *work, size_t count,
                       supine_findings *findings) {
  supine_parallel_for(count, 1, count, load_range, work);
  for (size_t i = 0; i < count; ++i) {
    if (work->errors[i].status != SUPINE_OK) {
      return supine_options_fail(command, &work->errors[i]);
    }
    find(work->paths[i], &work->reports[i], findings);
  }
  work->axes = work->reports[0].axes;
  return SUPINE_EXIT_OK;
}

/* Surfaces from label maps. A lung alone has its inner face for a midline. */
static int load_maps(supine_model_options *options, const char *command, load_work *work,
                     size_t *count) {
  supine_command_maps maps = {
      .axes = options->load.axes, .surfaces = work->meshes, .findings = &options->findings};
  if (options->load.millimetres_per_unit != 0.0) {
    return supine_options_usage(command, "--units is for surfaces: a label map's header says them");
  }
  const int result =
      supine_command_labels_load(&options->maps, command, work->paths, *count, &maps);
  *count = maps.count;
  work->axes = maps.axes;
  for (size_t i = 0; i < *count && result == SUPINE_EXIT_OK; ++i) {
    work->reports[i] = (supine_mesh_report){.axes = SUPINE_AXES_LPS, .axes_from_tag = true};
  }
  if (result == SUPINE_EXIT_OK && *count == 1 && !options->has_midline) {
    double low[3];
    double high[3];
    supine_mesh_box(&work->meshes[0], low, high);
    options->midline = maps.sides[0] > 0 ? low[0] : high[0];
    options->has_midline = true;
  }
  return result;
}

/* Checks and joins what was loaded. */
static int make_lungs(supine_model_options *options, const char *command, const load_work *work,
                      size_t count, bool maps, supine_lungs *lungs) {
  const supine_lungs_source source = {.name = work->paths[0],
                                      .axes = work->axes,
                                      .axes_given = options->load.axes != SUPINE_AXES_AUTO,
                                      .units_given = options->load.millimetres_per_unit != 0.0,
                                      .midline = options->has_midline ? &options->midline : NULL};
  supine_error error;
  bool hold = false;
  const supine_status status =
      supine_lungs_gate(work->meshes, count, &source, lungs, &hold, &options->findings, &error);
  supine_options_say_findings(command, &options->findings);
  if (status != SUPINE_OK) {
    return supine_options_fail(command, &error);
  }
  if (maps && hold) {
    (void)printf("narrow at the head, deepest at the back, the heart on the left, as in people: "
                 "the header's axes hold\n");
  }
  return SUPINE_EXIT_OK;
}

/* The law, force and stiffness of a person, and what the scan shows of the two that were fitted. */
static supine_status set_patient(supine_model_options *options, const char *command,
                                 const supine_lungs *lungs, supine_error *error) {
  const supine_patient_record *record = options->patient;
  size_t state = 0;
  if (record == NULL) {
    return SUPINE_OK;
  }
  const supine_status status = supine_patient_check_place(record, lungs, &state, error);
  if (status != SUPINE_OK) {
    return status;
  }
  supine_patient_model(record, &options->model);
  supine_patient_resting(record, &options->resting);
  if (!options->has_scan) {
    const double volume = lungs->topology.closed ? 1e-3 * supine_mesh_volume(&lungs->mesh) : 0.0;
    options->scan = supine_patient_scan(record, state, volume, &options->resting);
    if (state == 1 && options->scan.kind == SUPINE_SCAN_NONE) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "this is the emptier of the two scans that were fitted, and nothing "
                              "tells how far it is from full inflation: name its state, as "
                              "--scanned supine:rest, or take the fuller scan");
    }
    supine_options_say(command,
                       "note: taken as the %s of the two states that were fitted; "
                       "--scanned says otherwise",
                       state == 0 ? "fuller" : "emptier");
  }
  if (!supine_patient_is_uneven(record)) {
    return SUPINE_OK;
  }
  if (options->stiffness != NULL) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the patient's law brings its own stiffness: leave --expandability "
                            "out");
  }
  options->stiffness = malloc(lungs->mesh.vertex_count * sizeof *options->stiffness);
  if (options->stiffness == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices",
                            lungs->mesh.vertex_count);
  }
  options->model.stiffness = options->stiffness;
  return supine_patient_set_stiffness(record, lungs, options->stiffness, error);
}

/* Over 60 lines: one step after another, each with its message. */
int supine_command_model_load(supine_model_options *options, const char *command, char **paths,
                              size_t count, bool keep, supine_lungs *lungs) {
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  bool maps = false;
  int result = supine_command_labels_check(&options->maps, command, paths, count, &maps);
  if (result != SUPINE_EXIT_OK) {
    return result;
  }
  const size_t most = count > 2 ? count : 2; /* a map holds two lungs */
  load_work work = {&options->load,
                    paths,
                    calloc(most, sizeof(supine_mesh)),
                    calloc(most, sizeof(supine_mesh_report)),
                    SUPINE_AXES_AUTO,
                    calloc(most, sizeof(supine_error))};
  if (work.meshes == NULL || work.reports == NULL || work.errors == NULL) {
    result = supine_options_fail(command, &error);
    goto cleanup;
  }
  result = maps ? load_maps(options, command, &work, &count)
                : load_meshes(command, &work, count, &options->findings);
  if (result == SUPINE_EXIT_OK) {
    result = make_lungs(options, command, &work, count, maps, lungs);
  }
  if (result != SUPINE_EXIT_OK) {
    goto cleanup;
  }
  if (keep) {
    options->scan.kind = SUPINE_SCAN_NONE;
    options->has_scan = true;
  }
  result = choose_law(options, command);
  if (result != SUPINE_EXIT_OK) {
    goto cleanup;
  }
  if (set_expandability(options, &work, count, lungs, &error) != SUPINE_OK ||
      set_directions(options, lungs, &error) != SUPINE_OK ||
      set_lesions(options, command, lungs, &error) != SUPINE_OK ||
      set_shares(options, lungs, &error) != SUPINE_OK ||
      set_patient(options, command, lungs, &error) != SUPINE_OK ||
      supine_reference_find(lungs, &options->model, &options->scan, &options->resting,
                            &options->reference, &error) != SUPINE_OK) {
    result = supine_options_fail(command, &error);
    goto cleanup;
  }
  options->frame = frame_of(options, work.reports, count);
  say_assumed(options, lungs, &work.reports[0]);
cleanup:
  for (size_t i = 0; work.meshes != NULL && i < most; ++i) {
    supine_mesh_free(&work.meshes[i]);
  }
  free(work.meshes);
  free(work.reports);
  free(work.errors);
  return result;
}
