/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine fit: a person's own law, from that person's scans and landmarks. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/text.h"

#include "precompute/lungs/gate.h"
#include "precompute/patient/gain.h"
#include "precompute/patient/patient_file.h"
#include "precompute/patient/surfaces.h"
#include "program/options/command.h"
#include "program/options/posture_list.h"
#include "program/options/surface_options.h"

static const char name[] = "fit";

typedef struct request {
  const char *path, *landmarks, *name;
  bool reverse, translation, rigid, has_law, has_midline, has_gain, expandability, json;
  int law;
  double midline, gain, reach;
  supine_mesh_load_options load;

  supine_patient_scan rest, state;
  size_t count; /* of further states, or of all where no other was named */
  supine_patient_scan further[SUPINE_PATIENT_OTHERS_MAX];
  const char *further_path[SUPINE_PATIENT_OTHERS_MAX];
  const char *rest_path, *state_path; /* surfaces; NULL: none */
} request;

/* "supine", "prone:rest", "supine+15:-3000" */
static int read_scan(const char *command, const char *text, void *field) {
  supine_patient_scan *scan = field;
  const char *colon = strchr(text, ':');
  const size_t length = colon != NULL ? (size_t)(colon - text) : strlen(text);
  supine_posture_list list;
  double litres;
  if (length >= sizeof scan->posture ||
      (colon != NULL && strcmp(colon + 1, "full") != 0 && strcmp(colon + 1, "rest") != 0 &&
       !supine_options_parse_number(colon + 1, &litres)) ||
      (colon != NULL && strlen(colon + 1) >= sizeof scan->volume)) {
    return SUPINE_OPTION_MISFIT;
  }
  (void)snprintf(scan->posture, sizeof scan->posture, "%.*s", (int)length, text);
  (void)snprintf(scan->volume, sizeof scan->volume, "%s", colon != NULL ? colon + 1 : "");
  const int result = supine_options_posture_list_parse(command, scan->posture, &list);
  if (result != SUPINE_EXIT_OK || list.count != 1) {
    return result != SUPINE_EXIT_OK ? result : SUPINE_OPTION_MISFIT;
  }
  memcpy(scan->gravity, list.item[0].gravity, sizeof scan->gravity);
  return SUPINE_EXIT_OK;
}

/* "prone:PAIRS.csv", "prone:rest:PRONE.ply", into the whole request. */
static int read_state(const char *command, const char *text, void *field) {
  request *wanted = field;
  const char *colon = strrchr(text, ':');
  char posture[2 * SUPINE_PATIENT_TEXT];
  if (wanted->count == SUPINE_PATIENT_OTHERS_MAX || colon == NULL || colon[1] == '\0' ||
      (size_t)(colon - text) >= sizeof posture) {
    return SUPINE_OPTION_MISFIT;
  }
  (void)snprintf(posture, sizeof posture, "%.*s", (int)(colon - text), text);
  wanted->further_path[wanted->count] = colon + 1;
  return read_scan(command, posture, &wanted->further[wanted->count++]);
}

static bool is_landmarks(const char *path) {
  return supine_text_ends_in(path, ".csv");
}

#define FILLS(member) SUPINE_FILLS(request, member)

static const supine_option table[] = {
    {"output", 'o', "FILE", "what was found (JSON), for 'supine precompute --patient'", FILLS(path),
     .file = SUPINE_FILE_OUT},
    {"landmarks", 0, "FILE",
     "matched points, mm, LPS: CSV with the columns x,y,z,to_x,to_y,to_z (from rest to the other "
     "state), or im1_x,im1_y,im1_z,im2_x,im2_y,im2_z (image 1 inhaled, image 2 exhaled: from 2 to "
     "1)",
     FILLS(landmarks), .file = SUPINE_FILE_IN},
    {"reverse", 0, NULL, "rest is the other one of the two", FILLS(reverse)},
    {"rest", 0, "POSTURE[:VOLUME]",
     "how the person lay at rest, and how full the lungs were: full, rest or mL", FILLS(rest),
     .read = read_scan, .standard = "supine",
     .wants = "a posture, and :full, :rest or :ML after it"},
    {"other", 0, "POSTURE[:VOLUME]", "the same of the other state", FILLS(state), .read = read_scan,
     .standard = "supine", .wants = "a posture, and :full, :rest or :ML after it"},
    {"translation", 0, NULL,
     "the scans' frames may be shifted against each other: finds the shift as well",
     FILLS(translation), .rivals = "motion"},
    {"rigid", 0, NULL, "or shifted and slightly turned", FILLS(rigid), .rivals = "motion"},
    {"law", 0, "LAW",
     "paper: c1 to c6 and the force of the published law; affine: one affine map; quadratic: one "
     "of second degree for each lung. Default: what leaves least of points that it has not seen",
     FILLS(law), SUPINE_SAYS_GIVEN(request, has_law), .choices = supine_patient_law_names},
    {"name", 0, "TEXT", "whose lungs these are; default: the landmarks' file", FILLS(name)},
    {"gain", 0, "G",
     "how much of the force turns with gravity. Two scans in one posture cannot tell it from what "
     "stays with the body; default 0.4, the 'deep' law's",
     FILLS(gain), SUPINE_SAYS_GIVEN(request, has_gain), .range = {0.0, 2.0}},
    {"state", 0, "POSTURE[:VOLUME]:FILE",
     "a further state from the same rest, its surface or its landmarks (.csv); may be repeated, up "
     "to 8. In another posture than the fitted state it tells the gain, in the same one how far "
     "that breath went; the law's other constants are the fitted state's. Without another state "
     "to fit to, the first is that",
     .read = read_state, .alias = "third",
     .wants = "(at most 8) a posture, perhaps :full, :rest or :ML, a colon and a file"},
    {"midline", 0, "X", "x of the plane between the lungs, mm; default: the middle of the points",
     FILLS(midline), SUPINE_SAYS_GIVEN(request, has_midline), .wants = "an x in mm"},
    {.table = supine_options_surface_frame, FILLS(load)},
    {"reach", 0, "MM",
     "of surfaces: forces spread over this length, as 'precompute --reach' has it", FILLS(reach),
     .standard = "10", SUPINE_ABOVE_ZERO, .wants = "a length in mm above 0"},
    {"expandability", 0, NULL,
     "of surfaces: finds how expandable which parts are, as well, under the 'deep' law's force, in "
     "regions some 45 mm apart, and says which it cannot see; kept where blocks that it has not "
     "seen come nearer",
     FILLS(expandability)},
    {"json", 0, NULL, "prints JSON instead of text", FILLS(json)},
    {.name = NULL}};

/* The deep law's: a lung's lowest parts are emptied about 1.5 times as far as its uppermost. */
static const double usual_gain = 0.4;

static void print_row(const char *what, double fitted, double held_out, const char *after) {
  (void)printf("  %-24s %7.2f   %7.2f%s\n", what, fitted, held_out, after);
}

static void print_scores(const supine_patient_fit_report *report, supine_patient_law kept) {
  static const char *const laws[] = {"law paper, (15)-(18)", "law affine", "law quadratic"};
  (void)printf("what is left of the displacement, mm RMS:\n"
               "                             fitted  held out\n");
  print_row("nothing moved", report->fitted.none, report->held_out.none, "");
  print_row("translation", report->fitted.translation, report->held_out.translation, "");
  print_row("affine, each lung", report->fitted.affine_lungs, report->held_out.affine_lungs, "");
  for (int k = 0; k < SUPINE_PATIENT_LAW_COUNT; ++k) {
    print_row(laws[k], report->fitted.law[k], report->held_out.law[k],
              k == (int)kept ? "   <- kept" : "");
  }
  (void)printf("held out: %d folds of 40 mm blocks that the fit had not seen, %d times over\n",
               SUPINE_PATIENT_FOLDS, SUPINE_PATIENT_SEEDS);
}

static void print_paper_law(const supine_patient *patient,
                            const supine_patient_fit_report *report) {
  double c[SUPINE_PATIENT_CONSTANTS];
  supine_patient_constants(patient, c);
  (void)printf(
      "the paper's law, force 1 at the box's centre (95 %% intervals, block bootstrap):\n");
  for (size_t k = 0; k < SUPINE_PATIENT_CONSTANTS; ++k) {
    const bool bounded = k >= 6 ? report->at_bound[k - 3] : k % 2 == 1 && report->at_bound[k / 2];
    (void)printf("  c%zu %8.3f   %8.3f to %8.3f%s\n", k + 1, c[k], report->low[k], report->high[k],
                 bounded ? "   at the bound of its range" : "");
  }
  (void)printf("six starts: %zu of %d end within 1 %% of the best; the fields differ by up to %.2g "
               "mm\n",
               report->starts_agreeing, SUPINE_PATIENT_STARTS, report->start_apart);
}

static void print_surface(const supine_patient_surface_report *surface, bool landmarks) {
  (void)printf("surface: %zu vertices, %.0f %% of them matched; to the other surface, along its "
               "normals,\n  %.2f mm RMS at rest, %.2f mm in the end; six starts end within %.2g mm "
               "of each other\n",
               surface->vertices, 100.0 * surface->matched, surface->before, surface->after,
               surface->point_apart);
  if (!landmarks) {
    (void)puts("a small distance between surfaces does not prove the motion of what is in them:\n"
               "  surfaces 5 mm apart have had points 14 mm off. Landmarks tell: --landmarks");
  }
}

/* The region that is seen and gives way least, or most. */
static void print_extreme(const supine_patient_stiffness *stiffness, const char *what,
                          double sign) {
  const supine_patient_mode *found = NULL;
  size_t lung = 0;
  for (size_t side = 0; side < 2; ++side) {
    for (size_t k = 0; k < stiffness->count[side]; ++k) {
      const supine_patient_mode *mode = &stiffness->mode[side][k];
      if (mode->seen >= SUPINE_PATIENT_SEEN &&
          (found == NULL || sign * mode->value > sign * found->value)) {
        found = mode;
        lung = side;
      }
    }
  }
  if (found != NULL) {
    (void)printf("  %s expandable: %s lung, %.0f mm about %.0f,%.0f,%.0f, %.2f\n", what,
                 lung == 0 ? "left" : "right", 0.5 * found->radius, found->centre[0],
                 found->centre[1], found->centre[2], found->value);
  }
}

/* The regions that move too little, or along the surface, to tell how expandable they are. */
static void print_unseen(const supine_patient_stiffness *stiffness,
                         const supine_patient_expand_report *expand) {
  (void)printf("  not seen: %zu of %zu regions, which have their neighbours' values%s\n",
               expand->unseen, expand->regions, expand->unseen > 0 ? ":" : "");
  for (size_t side = 0; side < 2; ++side) {
    for (size_t k = 0; k < stiffness->count[side]; ++k) {
      const supine_patient_mode *mode = &stiffness->mode[side][k];
      if (mode->seen < SUPINE_PATIENT_SEEN) {
        (void)printf("    %s lung, %.0f mm about %.0f,%.0f,%.0f\n", side == 0 ? "left" : "right",
                     0.5 * mode->radius, mode->centre[0], mode->centre[1], mode->centre[2]);
      }
    }
  }
}

static void print_expandability(const supine_patient_expand_report *expand,
                                const supine_patient_stiffness *stiffness) {
  if (expand->tried) {
    (void)printf("expandability: the surfaces come to %.2f mm RMS with it, %.2f without; held out "
                 "%.2f and %.2f:\n  ",
                 expand->fitted[1], expand->fitted[0], expand->held_out[1], expand->held_out[0]);
    if (expand->kept) {
      (void)printf(
          "kept; nine tenths of what is seen are %.2f to %.2f times as stiff as the mean\n",
          expand->softest, expand->stiffest);
      print_extreme(stiffness, "least", -1.0);
      print_extreme(stiffness, "most", 1.0);
      print_unseen(stiffness, expand);
    } else {
      (void)puts("no nearer to what it had not seen, and so not kept: stiffness stays even");
    }
  }
}

static void print_applied(const supine_patient_surface_fit *found) {
  const supine_patient_applied *applied = &found->applied;
  const double *c = found->patient.powers + 3;
  (void)printf("the force that the displacement shows, back through the operator, means of %zu "
               "blocks:\n"
               "  correlation with height along gravity %.2f; it varies by %.0f %% RMS, of which "
               "(18) leaves %.0f %%\n"
               "  c7 to c9 of that force %.2f %.2f %.2f, of the displacement %.2f %.2f %.2f\n",
               applied->blocks, applied->correlation, 100.0 * applied->spread,
               100.0 * applied->left, applied->slopes[0], applied->slopes[1], applied->slopes[2],
               c[0], c[1], c[2]);
}

static void print_gain(const supine_patient_record *record, bool given) {
  for (size_t k = 0; k < record->told_count; ++k) {
    const supine_patient_told *told = &record->told[k];
    (void)printf("%s: breath scale %.2f, leaves %.1f mm RMS, %.1f were no force to turn\n",
                 told->posture, told->scale, told->left, told->left_without);
  }
  if (record->gain_told) {
    (void)printf("gain %.2f +- %.2f turns with gravity, by the states in other postures\n",
                 record->force.gain, record->gain_error);
  } else if (!given) {
    (void)printf("one posture cannot tell what turns with gravity from what stays with the body:\n"
                 "gain %.2g is the deep law's, or --gain, or of a --state in another posture\n",
                 record->force.gain);
  }
}

static void print_text(const supine_patient_record *record, const supine_patient_fit_report *report,
                       const request *wanted) {
  const supine_patient *patient = &record->patient;
  const bool moved = wanted->translation || wanted->rigid;
  (void)printf("%zu %s in %zu blocks of 40 mm\n", report->count,
               report->components == 3 ? "landmarks" : "measurements", report->blocks);
  print_scores(report, patient->law);
  if (moved) {
    const double *t = patient->motion;
    (void)printf("motion between the scans, as the paper's law has it: %.1f,%.1f,%.1f mm", t[0],
                 t[1], t[2]);
    if (wanted->rigid) {
      (void)printf(", turned by %.1f degrees",
                   sqrt(t[3] * t[3] + t[4] * t[4] + t[5] * t[5]) * 57.29577951308232);
    }
    (void)putchar('\n');
  }
  print_paper_law(patient, report);
  (void)printf("kept: %s, which explains %.0f %% of the squared displacement%s held out (%.0f %% "
               "fitted)\n",
               supine_patient_law_names[patient->law], 100.0 * report->explained,
               moved ? " about the motion between the scans" : "",
               100.0 * report->explained_fitted);
  (void)printf("the paper's constants were accurate to 1 %%, its validation to 2 mm: here %.1f mm "
               "are left\n",
               record->held_out);
}

/* "left.ply,right.ply" as one model. */
static supine_status load_lungs(const request *wanted, const char *operand, supine_lungs *lungs,
                                supine_error *error) {
  enum { FILES_MAX = 2 };
  supine_mesh meshes[FILES_MAX] = {0};
  supine_mesh_report report = {0};
  size_t count = 0;
  char *names = strdup(operand);
  char *rest = names;
  supine_status status = names == NULL
                             ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for a name")
                             : SUPINE_OK;
  for (char *path; status == SUPINE_OK && (path = strsep(&rest, ",")) != NULL;) {
    status =
        count == FILES_MAX
            ? supine_error_set(error, SUPINE_ERROR_ARGUMENT, "'%s': two lungs at most", operand)
            : supine_mesh_load(path, &wanted->load, &meshes[count++], &report, error);
  }
  if (status == SUPINE_OK) {
    supine_findings findings = {""};
    const supine_lungs_source source = {.name = operand,
                                        .axes = report.axes,
                                        .axes_given = wanted->load.axes != SUPINE_AXES_AUTO,
                                        .units_given = wanted->load.millimetres_per_unit != 0.0,
                                        .midline = wanted->has_midline ? &wanted->midline : NULL};
    status = supine_lungs_gate(meshes, count, &source, lungs, NULL, &findings, error);
    supine_options_say_findings(name, &findings);
  }
  for (size_t i = 0; i < FILES_MAX; ++i) {
    supine_mesh_free(&meshes[i]);
  }
  free(names);
  return status;
}

static supine_status fit_surfaces(const request *wanted, const supine_patient_pairs *pairs,
                                  const supine_patient_fit_options *options,
                                  supine_patient_surface_fit *found, supine_error *error) {
  supine_lungs rest = {0};
  supine_lungs state = {0};
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  supine_progress progress = supine_options_progress_begin(name);
  model.reach = wanted->reach;
  model.force = supine_physics_model(SUPINE_LAW_DEEP).force; /* held where tissue is to be found */
  model.force.gain = wanted->has_gain ? wanted->gain : usual_gain;
  supine_status status = load_lungs(wanted, wanted->rest_path, &rest, error);
  if (status == SUPINE_OK) {
    status = load_lungs(wanted, wanted->state_path, &state, error);
  }
  if (status == SUPINE_OK) {
    supine_patient_surface_task task = {.rest = &rest,
                                        .state = &state.mesh,
                                        .model = &model,
                                        .landmarks = pairs,
                                        .options = *options,
                                        .expandability = wanted->expandability,
                                        .progress = supine_options_progress_step,
                                        .progress_context = &progress};
    memcpy(task.gravity, wanted->state.gravity, sizeof task.gravity);
    supine_options_signals_catch(true);
    status = supine_patient_fit_surface(&task, found, error);
    supine_options_progress_end(&progress);
  }
  supine_lungs_free(&rest);
  supine_lungs_free(&state);
  return status;
}

static supine_status fit_landmarks(const request *wanted, const supine_patient_pairs *pairs,
                                   const supine_patient_fit_options *options,
                                   supine_patient_surface_fit *found, supine_error *error) {
  const supine_patient_frame frame = supine_patient_frame_of_points(
      pairs->count, pairs->from, wanted->has_midline ? &wanted->midline : NULL);
  supine_patient_row *rows = malloc(3 * pairs->count * sizeof *rows);
  if (rows == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu landmarks",
                            pairs->count);
  }
  supine_patient_rows_of_pairs(&frame, pairs, rows);
  const supine_status status = supine_patient_fit(&frame, rows, pairs->count, 3, options,
                                                  &found->patient, &found->report, error);
  free(rows);
  return status;
}

/* Further states: what of the force turns. */
typedef struct further_work {
  supine_patient_pairs pairs[SUPINE_PATIENT_OTHERS_MAX];
  supine_lungs lungs[SUPINE_PATIENT_OTHERS_MAX], rest;
  supine_patient_other other[SUPINE_PATIENT_OTHERS_MAX];
} further_work;

static supine_status load_further(const request *wanted, bool moved, further_work *work,
                                  supine_error *error) {
  supine_status status = SUPINE_OK;
  for (size_t k = 0; k < wanted->count && status == SUPINE_OK; ++k) {
    const char *path = wanted->further_path[k];
    memcpy(work->other[k].gravity, wanted->further[k].gravity, sizeof work->other[k].gravity);
    if (is_landmarks(path)) {
      status = supine_patient_pairs_load(path, wanted->reverse, &work->pairs[k], error);
      if (status == SUPINE_OK) {
        status = supine_patient_pairs_check(&work->pairs[k], moved, error);
      }
      work->other[k].pairs = &work->pairs[k];
      continue;
    }
    if (work->rest.mesh.vertex_count == 0) {
      status = load_lungs(wanted, wanted->rest_path, &work->rest, error);
    }
    if (status == SUPINE_OK) {
      status = load_lungs(wanted, path, &work->lungs[k], error);
      work->other[k].surface = &work->lungs[k].mesh;
    }
  }
  return status;
}

static supine_status find_gain(const request *wanted, supine_patient_record *record,
                               supine_error *error) {
  const bool moved = wanted->translation || wanted->rigid;
  further_work *work = calloc(1, sizeof *work);
  supine_patient_gain gain = {0};
  supine_status status =
      work == NULL ? supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for further states")
                   : load_further(wanted, moved, work, error);
  if (status == SUPINE_OK) {
    status = supine_patient_gain_fit(record, &work->rest, wanted->reach, moved, work->other,
                                     wanted->count, &gain, error);
  }
  if (status == SUPINE_OK) {
    record->gain_told = gain.told;
    record->gain_error = gain.error;
    record->force = supine_patient_force(&record->patient, gain.gain, record->state.gravity);
    record->told_count = wanted->count;
    for (size_t k = 0; k < wanted->count; ++k) {
      const supine_patient_other *other = &work->other[k];
      record->told[k] = (supine_patient_told){"", other->scale, other->left, other->left_without};
      memcpy(record->told[k].posture, wanted->further[k].posture, sizeof record->told[k].posture);
    }
  }
  for (size_t k = 0; work != NULL && k < SUPINE_PATIENT_OTHERS_MAX; ++k) {
    supine_patient_pairs_free(&work->pairs[k]);
    supine_lungs_free(&work->lungs[k]);
  }
  if (work != NULL) {
    supine_lungs_free(&work->rest);
  }
  free(work);
  return status;
}

static void keep(const request *wanted, const supine_patient_surface_fit *found,
                 supine_patient_record *record) {
  const supine_patient_fit_report *report = &found->report;
  const supine_patient_law law = found->patient.law;
  const supine_patient_scores *held = &report->held_out;
  const char *source = wanted->landmarks != NULL ? wanted->landmarks : wanted->state_path;
  const char *slash = strrchr(source, '/');
  (void)snprintf(record->name, sizeof record->name, "%s",
                 wanted->name != NULL ? wanted->name
                 : slash != NULL      ? slash + 1
                                      : source);
  record->patient = found->patient;
  record->stiffness = found->stiffness;
  record->expand = found->expand;
  record->applied = found->applied;
  record->rest = wanted->rest;
  record->state = wanted->state;
  record->from_surface = wanted->state_path != NULL;
  record->inflation = supine_patient_inflation(&record->patient);
  record->force = supine_patient_force(
      &record->patient, wanted->has_gain ? wanted->gain : usual_gain, wanted->state.gravity);
  record->points = report->count;
  record->held_out = held->law[law];
  record->held_out_baseline = wanted->translation || wanted->rigid ? held->translation : held->none;
  record->fitted = report->fitted.law[law];
  record->explained = report->explained;
}

static supine_status fit(const request *wanted, const supine_arguments *given,
                         supine_patient_surface_fit *found, supine_patient_record *record,
                         supine_error *error) {
  const supine_patient_fit_options options = {.law_given = wanted->has_law,
                                              .law = (supine_patient_law)wanted->law,
                                              .moved = wanted->rigid ? SUPINE_PATIENT_RIGID
                                                       : wanted->translation
                                                           ? SUPINE_PATIENT_TRANSLATION
                                                           : SUPINE_PATIENT_STILL};
  supine_patient_pairs pairs = {0};
  supine_status status = SUPINE_OK;
  if (wanted->landmarks != NULL) {
    status = supine_patient_pairs_load(wanted->landmarks, wanted->reverse, &pairs, error);
    if (status == SUPINE_OK) {
      status = supine_patient_pairs_check(&pairs, options.moved != SUPINE_PATIENT_STILL, error);
    }
  }
  if (status == SUPINE_OK) {
    status = wanted->state_path != NULL
                 ? fit_surfaces(wanted, pairs.count > 0 ? &pairs : NULL, &options, found, error)
                 : fit_landmarks(wanted, &pairs, &options, found, error);
  }
  if (status == SUPINE_OK) {
    keep(wanted, found, record);
    if (wanted->count > 0) {
      status = find_gain(wanted, record, error);
    }
    if (status == SUPINE_OK && wanted->path != NULL) {
      status = supine_patient_write(wanted->path, record, &found->report, given->made_by, error);
    }
  }
  supine_patient_pairs_free(&pairs);
  return status;
}

/* Which surfaces and landmarks the law is fitted to, and which states are further ones. */
static int arrange(request *wanted, const supine_arguments *given) {
  size_t next = 1;
  wanted->rest_path = given->count > 0 ? given->operand[0] : NULL;
  if (given->count > 1) {
    wanted->state_path = given->operand[next++];
  } else if (wanted->landmarks == NULL && wanted->count > 0) { /* the first state is the one */
    *(is_landmarks(wanted->further_path[0]) ? &wanted->landmarks : &wanted->state_path) =
        wanted->further_path[0];
    wanted->state = wanted->further[0];
    --wanted->count;
    memmove(wanted->further, wanted->further + 1, wanted->count * sizeof *wanted->further);
    memmove(wanted->further_path, wanted->further_path + 1,
            wanted->count * sizeof *wanted->further_path);
  }
  for (; next < given->count; ++next) { /* more in the same posture */
    if (wanted->count == SUPINE_PATIENT_OTHERS_MAX) {
      return supine_options_usage(name, "more than %d further states", SUPINE_PATIENT_OTHERS_MAX);
    }
    wanted->further[wanted->count] = wanted->state;
    wanted->further_path[wanted->count++] = given->operand[next];
  }
  if (wanted->landmarks == NULL && wanted->state_path == NULL) {
    return supine_options_usage(name, "what to fit to? Name --landmarks, or the surface at rest "
                                      "and the one in the other state, or both");
  }
  for (size_t k = 0; k < wanted->count; ++k) {
    if (!is_landmarks(wanted->further_path[k]) && wanted->rest_path == NULL) {
      return supine_options_usage(name, "%s is a surface: name the one at rest as well",
                                  wanted->further_path[k]);
    }
  }
  if (wanted->state_path != NULL && wanted->rest_path == NULL) {
    return supine_options_usage(name, "%s is a surface: name the one at rest as well",
                                wanted->state_path);
  }
  if (wanted->expandability && wanted->state_path == NULL) {
    return supine_options_usage(name, "--expandability is of surfaces: name the one at rest and "
                                      "the one in the other state");
  }
  if (wanted->has_gain && wanted->count > 0) {
    return supine_options_usage(name, "--gain or --state: further states tell the gain");
  }
  return SUPINE_EXIT_OK;
}

static int run(void *chosen, const supine_arguments *given) {
  request *wanted = chosen;
  supine_patient_record record = {0};
  supine_patient_surface_fit found = {0};
  supine_error error;
  const int result = arrange(wanted, given);
  if (result != SUPINE_EXIT_OK) {
    return result;
  }
  if (fit(wanted, given, &found, &record, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  if (wanted->json) {
    char *text = supine_patient_text(&record, &found.report, given->made_by);
    (void)puts(text != NULL ? text : "{}");
    free(text);
  } else {
    if (wanted->state_path != NULL) {
      print_surface(&found.surface, wanted->landmarks != NULL);
    }
    print_text(&record, &found.report, wanted);
    if (wanted->state_path != NULL) {
      print_expandability(&found.expand, &found.stiffness);
      print_applied(&found);
    }
    print_gain(&record, wanted->has_gain);
  }
  return supine_options_finish(name);
}

const supine_command supine_command_fit = {
    name,
    "a person's own law, from scans and landmarks",
    .usage = "--landmarks PAIRS.csv -o patient.json [OPTIONS]\n"
             "REST STATE... [--state POSTURE:FILE]... -o patient.json [OPTIONS]",
    .about =
        "Fits how one person's lungs move to matched points of two scans, and says how much of "
        "the motion of points that it has not seen each law explains. 'supine precompute "
        "--patient' makes a basis of what is kept.",
    .options = table,
    .notes =
        "Example:\n"
        "  supine fit --landmarks pairs.csv --translation --rest supine:rest "
        "--other supine:full -o patient.json\n"
        "  supine fit rest.ply full.ply --other supine:full --landmarks pairs.csv -o patient.json\n"
        "  supine fit rest.ply full.ply --state prone:rest:prone.ply -o patient.json\n"
        "  supine precompute lungs.ply --patient patient.json -o lungs.safetensors",
    .operands_least = 0,
    .operands_most = 2 + SUPINE_PATIENT_OTHERS_MAX,
    .operands_missing = "one surface at rest and some in other states",
    .request_size = sizeof(request),
    .run = run};
