/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Options that choose the lungs and the model of their mechanics. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "precompute/names.h"
#include "precompute/patient/checks.h"
#include "program/options/model_options.h"
#include "program/options/state_options.h"
#include "program/options/surface_options.h"

static supine_status read_scan(const char *text, void *field, supine_error *error) {
  supine_precompute_scan *given = &((supine_model_options *)field)->precompute.scan;
  supine_state posture = {.volume = {SUPINE_VOLUME_DEFAULT, 0.0}};
  supine_scan scan;
  given->shown = SUPINE_SHOWN_STATE;
  if (supine_state_parse_posture(text, &posture, NULL) == SUPINE_OK) {
    given->state = posture;
    return SUPINE_OK;
  }
  SUPINE_TRY(supine_physics_reference_scan_parse(text, &scan, error));
  given->shown = scan.known ? SUPINE_SHOWN_STATE : SUPINE_SHOWN_UNKNOWN;
  given->state = scan.state;
  return SUPINE_OK;
}

/* Read volumes at rest, such as "supine=0.48,prone=2600mL" or "copd". */
static supine_status read_resting(const char *text, void *field, supine_error *error) {
  supine_precompute_volumes *volumes = &((supine_model_options *)field)->precompute.volumes;
  char piece[64];
  for (const char *at = text; supine_options_next_item(&at, piece, sizeof piece);) {
    supine_resting read = supine_physics_resting_default();
    char *value = strchr(piece, '=');
    if (value != NULL) {
      *value++ = '\0';
    } else if (strcmp(piece, "copd") != 0) {
      return SUPINE_ERROR_ARGUMENT;
    }
    SUPINE_TRY(supine_physics_resting_set(&read, piece, value, error));
    volumes->copd = volumes->copd || strcmp(piece, "copd") == 0;
    for (size_t axis = 0; axis < SUPINE_REST_COUNT; ++axis) {
      if (read.given[axis] && read.ml[axis] > 0.0) {
        volumes->rest[axis] = (supine_precompute_rest){.ml = read.ml[axis]};
      } else if (read.given[axis]) {
        volumes->rest[axis] =
            (supine_precompute_rest){.share = {read.share[0][axis], read.share[1][axis]}};
      }
    }
  }
  return SUPINE_OK;
}

/* Read "uniform", or "linear:AXIS:FROM:TO" or "exp:AXIS:FROM:TO" with the expandability at both
 * ends of an axis x, y or z; any other text names a file. */
static supine_status read_expandability(const char *text, void *field, supine_error *error) {
  supine_precompute_tissue *tissue = &((supine_model_options *)field)->precompute.tissue;
  const bool linear = strncmp(text, "linear:", strlen("linear:")) == 0;
  char axis;
  char from[32];
  char to[32];
  (void)error;
  tissue->expandability = NULL;
  tissue->profile = SUPINE_PROFILE_UNIFORM;
  if (strcmp(text, "uniform") == 0) {
    return SUPINE_OK;
  }
  if (!linear && strncmp(text, "exp:", strlen("exp:")) != 0) {
    tissue->expandability = text;
    return SUPINE_OK;
  }
  if (sscanf(text, "%*[a-z]:%c:%31[^:]:%31s", &axis, from, to) != 3 || axis < 'x' || axis > 'z') {
    return SUPINE_ERROR_ARGUMENT;
  }
  tissue->profile = linear ? SUPINE_PROFILE_LINEAR : SUPINE_PROFILE_EXPONENTIAL;
  tissue->axis = axis - 'x';
  return supine_options_fits(supine_options_parse_number(from, &tissue->from) &&
                             supine_options_parse_number(to, &tissue->to) && tissue->from > 0.0 &&
                             tissue->to > 0.0);
}

static supine_status read_lesion(const char *text, void *field, supine_error *error) {
  supine_precompute_tissue *tissue = &((supine_model_options *)field)->precompute.tissue;
  const char *factor = strrchr(text, ',');
  char lengths[128];
  double v[5];
  if (tissue->lesion_count == SUPINE_PRECOMPUTE_LESIONS_MAX || factor == NULL ||
      (size_t)(factor - text) >= sizeof lengths ||
      !supine_options_parse_number(factor + 1, &v[4])) {
    return SUPINE_ERROR_ARGUMENT;
  }
  (void)snprintf(lengths, sizeof lengths, "%.*s", (int)(factor - text), text);
  SUPINE_TRY(supine_quantity_parse(lengths, SUPINE_QUANTITY_LENGTH, 4, v, error));
  if (!(v[3] > 0.0) || !(v[4] > 0.0)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  tissue->lesions[tissue->lesion_count++] =
      (supine_precompute_lesion){{v[0], v[1], v[2]}, v[3], v[4]};
  return SUPINE_OK;
}

/* Read a collapsed lung and the share of its volume that remains, such as "left:0.3". */
static supine_status read_lung(const char *text, void *field, supine_error *error) {
  supine_precompute_tissue *tissue = &((supine_model_options *)field)->precompute.tissue;
  const bool left = strncmp(text, "left:", strlen("left:")) == 0;
  double share;
  if (!(left || strncmp(text, "right:", strlen("right:")) == 0) ||
      !supine_options_parse_number(strchr(text, ':') + 1, &share) ||
      !(share > 0.0 && share <= 1.0)) {
    return SUPINE_ERROR_ARGUMENT;
  }
  SUPINE_REFUSE_IF(tissue->share[left ? 0 : 1] > 0.0, error, SUPINE_ERROR_ARGUMENT,
                   "the %s lung is given twice: give its share once", left ? "left" : "right");
  tissue->share[left ? 0 : 1] = share;
  return SUPINE_OK;
}

/* Parts of help texts: a line that describes each displacement law, and the defaults of its
 * constants. */
#define LAW_HELP(id, name, base, gain, box, constants, shear, bend, reach, pair, from_scan, what)  \
  name ": " what "\n"
#define LAW_BASE(id, name, base, ...) "; default " #base " for " name
#define LAW_GAIN(id, name, base, gain, ...) "; default " #gain " for " name
#define LAW_BOX(id, name, base, gain, box, ...) "; default " #box " for " name
#define LAW_CONSTANTS(id, name, base, gain, box, constants, ...)                                   \
  "; default " #constants " for " name
#define LAW_SHEAR(id, name, base, gain, box, constants, shear, ...) "; default " #shear " for " name

#define FILLS(member) SUPINE_FILLS(supine_model_options, member)
#define GIVEN(member) SUPINE_SAYS_GIVEN(supine_model_options, member)

const supine_option supine_options_model[] = {
    {.help = "Surfaces:"},
    {.table = supine_options_surface_frame, FILLS(frame)},
    {"midline", 0, "X",
     "x of the sagittal plane between the lungs, in mm and LPS; default the middle of the bounding "
     "box of two lungs, or the medial side of a single lung",
     FILLS(precompute.lungs.midline), GIVEN(precompute.lungs.has_midline), SUPINE_MEASURES(LENGTH),
     .more = true},
    {.help = "Label maps (.nrrd, .nii, .nii.gz, .mha, or .dcm for a DICOM segmentation) instead of "
             "surfaces: one map, one mask per file, or the folder of masks that TotalSegmentator "
             "writes:"},
    {"labels", 0, "WHICH",
     "labels of the lungs: lungmask (1 right, 2 left), lobes (1, 2 left, 3 to 5 right), "
     "totalsegmentator (10 to 14), totalsegmentator-v1 (13 to 17), one (every label but 0 is lung; "
     "left and right are separated), or a list such as left=10+11,right=12+13+14, or left=2 for "
     "one lung. By default, the labels in the map decide, if they are unambiguous; of a DICOM "
     "segmentation, the SNOMED codes of its segments, whose numbers are the labels",
     FILLS(precompute.lungs.labels)},
    {"edge", 0, "MM", "edge length of the surface's triangles; default 2",
     FILLS(precompute.lungs.edge), .range = {0.2, 20.0}, SUPINE_MEASURES(LENGTH), .more = true},
    {"close", 0, "MM",
     "close gaps and channels narrower than twice MM, which vessels leave in masks; default 0",
     FILLS(precompute.lungs.close), .range = {0.0, 20.0}, SUPINE_MEASURES(LENGTH)},
    {"surfaces-out", 0, "FILE", "also write the surfaces: " SUPINE_MESH_ENDINGS,
     FILLS(precompute.lungs.surfaces_out), .file = SUPINE_FILE_OUT, .endings = SUPINE_MESH_ENDINGS,
     .more = true},
    {.help = "The scan:"},
    {"scanned", 0, "STATE",
     "state of the lungs in the scan\nfull: a breath-hold at full inflation (TLC)\nPOSTURE:rest: "
     "the end of a quiet expiration (FRC). POSTURE is supine, prone, left or right (lying on that "
     "side), upright or inverted\nnone: unknown. Breaths are added to the shape in the scan, and a "
     "change of posture alone does not deform it\nPOSTURE alone: with --fields, which then do not "
     "displace the surface in this posture\nfull and rest may have +ML or -ML, for both lungs "
     "together: supine:rest+300, full-2000. Default full",
     .read = read_scan, .wants = "full or POSTURE:rest, optionally with +ML or -ML, or none"},
    {"resting", 0, "LIST",
     "volume of the patient's lungs at rest (FRC), for one posture or several, separated by "
     "commas\nPOSTURE=2600mL: gas and tissue of both lungs, as measured in a CT at rest\n"
     "POSTURE=0.48: a share of the volume at full inflation\nPOSTURE=0.47/0.49: shares for the "
     "left and the right lung\ncopd: the usual share in COPD, 0.64 supine (SD 0.11; ten patients)\n"
     "The volumes of other postures keep the default proportions to these. A lung-function test "
     "gives the gas alone, seated: add about 0.9 L of tissue, and give the sum as upright. "
     "Default, from healthy people (SD 0.08): the shares that 'supine info' prints, or the mL that "
     "--height and --sex predict (GLI 2021, less 0.806 L for lying, plus 0.86 L of tissue)\nWith "
     "--fields over volume: which of the simulated volumes is rest; by default it is unknown. "
     "Shares need --full",
     .read = read_resting, .wants = "copd, POSTURE=2600mL or POSTURE=SHARE,..."},
    {"full", 0, "VOLUME",
     "for a scan at rest: volume of gas and tissue of the scanned lungs at full inflation, such as "
     "4200mL or 4.2L. Without it, full inflation is assumed from the usual share at rest\nWith "
     "--fields over volume: which of the simulated volumes is full inflation, in every posture",
     FILLS(full), .read = supine_options_read_volume},
    {"height", 0, "CM",
     "height of the patient. Height and --sex give the volume expected at TLC (ECSC 1993, less 10 "
     "% for lying, plus 0.86 L of tissue), which is printed beside the volume of the scan. Without "
     "them, the range of adults is printed",
     FILLS(precompute.volumes.height), SUPINE_ABOVE_ZERO, SUPINE_MEASURES(HEIGHT), .more = true},
    {"sex", 0, "SEX", "female or male", FILLS(precompute.volumes.sex),
     .choices = supine_precompute_sexes, .more = true},
    {.help = "Law of motion. The force on a vertex is base + gain h + cx X + cy Y + cz Z. The "
             "depth h along gravity is 0 at the uppermost vertex and 1 at the lowermost. X, Y and "
             "Z are coordinates in the bounding box, from 0 to 1: X from the midline outwards, Y "
             "from back to front, Z from apex to base."},
    {"law", 0, "LAW",
     "how gravity and volume move the surface\n" SUPINE_LAWS(
         LAW_HELP) "The options from --base to --reach change constants of the law. Default deep",
     FILLS(law), GIVEN(has_law), .choices = supine_physics_law_names, .more = true},
    {"base", 0, "B", "part of the force that is equal everywhere" SUPINE_LAWS(LAW_BASE),
     FILLS(precompute.law.base), GIVEN(precompute.law.has_base), .more = true},
    {"gain", 0, "G", "factor of the depth h" SUPINE_LAWS(LAW_GAIN), FILLS(precompute.law.gain),
     GIVEN(precompute.law.has_gain), .more = true},
    {"box-force", 0, "X,Y,Z",
     "cx, cy and cz, the parts of the force that are fixed to the body" SUPINE_LAWS(LAW_BOX),
     FILLS(precompute.law.box_force), GIVEN(precompute.law.has_box_force),
     .wants = "three numbers, CX,CY,CZ", .more = true},
    {"soften", 0, "S",
     "multiply the expandability of the tissue by exp(S (h - mean h)), so that lower tissue "
     "expands more. With --law paper, --reach must be given too. Default 0",
     FILLS(precompute.law.soften), .more = true},
    {"constants", 0, "C1,...,C6",
     "constants of the displacement for a unit force, equations (15)-(17) of Santhanam 2008: C1 "
     "X^C2 outwards, C3 Y^C4 to the front and C5 Z^C6 to the feet, in mm. Those of deep are fitted "
     "to landmarks in ten full breaths (DIR-Lab COPDgene). Those of paper are fitted to landmarks "
     "in ten 4-D CTs (DIR-Lab), as the original ones are lost" SUPINE_LAWS(LAW_CONSTANTS),
     FILLS(precompute.law.constants), GIVEN(precompute.law.has_constants),
     .wants = "six numbers, C1,C2,C3,C4,C5,C6", .more = true},
    {"shear", 0, "BETA",
     "motion from back to front that grows from apex to base as lungs fill: BETA (Z - 1/2) times "
     "the RMS displacement" SUPINE_LAWS(LAW_SHEAR),
     FILLS(precompute.law.shear), GIVEN(precompute.law.has_shear), .more = true},
    {"reach", 0, "MM",
     "distance over which a force spreads along the surface: the force falls with the distance r "
     "about as exp(-r/MM). Without --reach, the paper law spreads it over a few edges of the mesh; "
     "in a finer mesh edges are shorter, and its surface may fold. Default 10 for deep",
     FILLS(precompute.law.reach), SUPINE_ABOVE_ZERO, SUPINE_MEASURES(LENGTH), .more = true},
    {.help = "Tissue. Expandability is the inverse of stiffness. Only its ratios between parts of "
             "the lungs count: doubling it everywhere changes nothing."},
    {"expandability", 0, "WHAT",
     "uniform: the same everywhere\nlinear:AXIS:FROM:TO, exp:AXIS:FROM:TO: it changes from FROM to "
     "TO, linearly or exponentially, along AXIS: x from the midline outwards, y from back to "
     "front, z from apex to base. With linear:z:0.5:1.5 the base expands most\nFILE: CSV with the "
     "expandability of every vertex: a column expandability, in the vertex order of 'supine solve' "
     "(left lung first); or the columns vertex,expandability, with vertices numbered from 0\n"
     "Default uniform",
     .read = read_expandability, .file = SUPINE_FILE_IN,
     .wants = "uniform, linear:AXIS:FROM:TO or exp:AXIS:FROM:TO with AXIS x, y or z and both ends "
              "above 0, or a file",
     .more = true},
    {"lesion", 0, "X,Y,Z,RADIUS,FACTOR",
     "lesion with its centre at X,Y,Z (mm, LPS). Within half of RADIUS (mm), the stiffness is "
     "multiplied by FACTOR; from there to RADIUS the multiplier changes smoothly to 1. A FACTOR "
     "above 1 stiffens the tissue, which then strains less. May be repeated, up to 64 times",
     .read = read_lesion, .repeats = true,
     .wants = "X,Y,Z,RADIUS,FACTOR, the last two above 0 (at most 64 times)"},
    {"lung", 0, "SIDE:SHARE",
     "collapsed lung (pneumothorax), left or right: SHARE, above 0 and at most 1, multiplies its "
     "volume in every state but the scan, which stays as it was scanned. The lung shrinks towards "
     "its hilum. The other lung takes the rest of each breath",
     .read = read_lung, .repeats = true,
     .wants = "left:SHARE or right:SHARE, above 0 and at most 1"},
    {.name = NULL}};

static void print_map(const char *path, const supine_source *source) {
  const supine_labels_report *report = &source->report;
  const supine_lungs *lungs = &source->lungs;
  supine_options_line("%s: %zu x %zu x %zu voxels of %.3g x %.3g x %.3g mm, %s (%s)\n  labels %s\n",
                      path, report->size[0], report->size[1], report->size[2], report->spacing[0],
                      report->spacing[1], report->spacing[2], report->axes, report->source,
                      report->taken);
  if (report->neck > 0.0) {
    supine_options_line("  the lungs touch: separated at necks up to %.3g mm wide\n", report->neck);
  }
  for (size_t i = 0; i < report->lung_count; ++i) {
    const supine_labels_lung *lung = &report->lung[i];
    supine_options_line("%s lung: %.1f mL", lung->side > 0 ? "left" : "right", lung->mask);
    if (lung->closed > 0.0) {
      supine_options_line("; closed gaps of %.2g mL", lung->closed);
    }
    supine_options_line("; dropped %zu %s (%.2g mL), filled %zu %s (%.2g mL)\n", lung->islands,
                        lung->islands == 1 ? "island" : "islands", lung->dropped, lung->cavities,
                        lung->cavities == 1 ? "cavity" : "cavities", lung->filled);
    supine_options_line("  surface of %zu vertices: %.1f mL",
                        lungs->lung_begin[i + 1] - lungs->lung_begin[i], lung->surface);
    if (fabs(lung->surface - lung->mask) >= 0.05) {
      supine_options_line(" (%+.2g mL)", lung->surface - lung->mask);
    }
    supine_options_line("\n");
  }
  if (source->axes_hold) {
    supine_options_line(
        "the shape of the lungs confirms the axes in the header: narrow at the head, "
        "deepest at the back, the heart on the left\n");
  }
}

/* Return what --json prints of the label map: its labels, and each lung. */
static json_t *list_map(const supine_labels_report *report) {
  json_t *lungs = json_array();
  for (size_t i = 0; i < report->lung_count; ++i) {
    const supine_labels_lung *lung = &report->lung[i];
    (void)json_array_append_new(lungs, json_pack("{s:s, s:f, s:f, s:f, s:f, s:f}", "name",
                                                 lung->side > 0 ? "left" : "right", "voxels_ml",
                                                 lung->mask, "closed_ml", lung->closed,
                                                 "dropped_ml", lung->dropped, "filled_ml",
                                                 lung->filled, "surface_ml", lung->surface));
  }
  return json_pack("{s:{s:s, s:s, s:o}}", "label_map", "labels", report->taken, "axes",
                   report->axes, "lungs", lungs);
}

supine_status supine_options_prepare(const char *command, supine_model_options *model,
                                     const supine_arguments *given, supine_prepared *prepared,
                                     supine_error *error) {
  supine_precompute_options *options = &model->precompute;
  const supine_volume *full = &model->full.volume;
  SUPINE_REFUSE_IF(
      full->kind != SUPINE_VOLUME_DEFAULT && full->kind != SUPINE_VOLUME_ABSOLUTE, error,
      SUPINE_ERROR_ARGUMENT,
      "--full is for a scan at rest: give a volume such as 4200mL, and --scanned supine:rest too");
  options->size = sizeof *options;
  options->volumes.full = full->ml;
  options->lungs.paths = (const char *const *)given->operand;
  options->lungs.path_count = given->count;
  options->lungs.unit = model->frame.millimetres_per_unit;
  if (model->frame.axes != SUPINE_AXES_AUTO) {
    supine_mesh_axes_letters(model->frame.axes, model->axes);
    options->lungs.axes = model->axes;
  }
  if (model->has_law) {
    options->law.kind = supine_precompute_law_of((supine_law)model->law);
  }
  supine_progress progress = supine_options_progress_begin("label map");
  options->progress = supine_options_progress_show;
  options->context = &progress;
  const supine_status status = supine_precompute_prepare(options, prepared, error);
  supine_options_progress_end(&progress);
  options->progress = NULL;
  options->context = NULL;
  if (prepared->source.is_map) {
    print_map(given->operand[0], &prepared->source);
    SUPINE_ADD_RESULT(list_map(&prepared->source.report));
  }
  supine_options_say_findings(command, &prepared->source.findings);
  return status;
}

supine_status supine_options_drop_mismatched(const char *command, const char *path,
                                             supine_patient_pairs *pairs, supine_error *error) {
  supine_findings findings = {.count = 0};
  const supine_status status = supine_patient_drop_mismatched(path, pairs, &findings, error);
  supine_options_say_findings(command, &findings);
  return status;
}

supine_status supine_options_load_lungs(const char *command, const char *operand,
                                        const supine_source_options *options, supine_lungs *lungs,
                                        supine_error *error) {
  char first[4096];
  const char *second = operand;
  supine_source source = {.is_map = false};
  (void)supine_options_next_item(&second, first, sizeof first);
  SUPINE_REFUSE_IF(second != NULL && strchr(second, ',') != NULL, error, SUPINE_ERROR_ARGUMENT,
                   "'%s' names more than two surfaces: give one or two", operand);
  const char *const paths[] = {first, second};
  const supine_status status =
      supine_precompute_source_load(options, paths, second != NULL ? 2 : 1, &source, error);
  supine_options_say_findings(command, &source.findings);
  *lungs = source.lungs;
  return status;
}
