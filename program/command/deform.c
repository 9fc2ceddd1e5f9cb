/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine deform: write the surface of a basis for a posture and a volume. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/csv.h"
#include "base/output.h"
#include "base/text.h"
#include <supine/runtime.h>

#include "program/command/deform_content.h"
#include "program/command/deform_samples.h"
#include "program/command/list.h"
#include "program/options/basis_input.h"
#include "program/options/facts.h"
#include "program/options/markups.h"
#include "program/options/state_notes.h"
#include "program/options/state_options.h"

static const char name[] = "deform";

typedef struct request {
  supine_orientation orientation;
  supine_volume_options volume;
  supine_from from;
  bool as_scanned;
  supine_frame frame;
  supine_deform_content content;
  size_t samples, seed;
  bool samples_given;
  size_t sample; /* number of the sample that a row of --states asks for */
  bool sample_given;
  const char *states; /* CSV file of states; NULL if the options give one state */
  /* Outputs in the columns output, labels and field of a row; the request owns these texts. */
  char *outputs[3];
} request;

#define POINTS_ENDINGS SUPINE_MESH_ENDINGS ", .csv, " SUPINE_MARKUPS_ENDING
#define ENDINGS POINTS_ENDINGS ", .nrrd, .nii, .nii.gz or .mha"
#define OUTPUT_ENDINGS POINTS_ENDINGS ", .safetensors, .nrrd, .nii, .nii.gz or .mha"

static const supine_option table[] = {
    {"output", 'o', "FILE",
     "file to write: " SUPINE_MESH_ENDINGS
     "; PLY and VTP files include displacements and expected errors. Embedded points can also be "
     "written as .csv or " SUPINE_MARKUPS_ENDING
     ", and moved images as .nrrd, .nii, .nii.gz or .mha; samples are .safetensors",
     SUPINE_FILLS(request, content.path), .file = SUPINE_FILE_OUT, .endings = OUTPUT_ENDINGS},
    {"states", 0, "LIST",
     "CSV file with a state in each row, in the columns posture, volume and output; the basis and "
     "the images are read once for all states. An output is a surface, points, or an image: the "
     "image of --image or --labels, moved, or without these the displacement field. With --image "
     "and --labels, the column labels has the file of the moved labels; the column field has that "
     "of the field. Each state's field is computed once. With the column sample, a number from 0 "
     "on, a row's outputs show that sample of --samples instead of the prediction, and state no "
     "expected errors. Paths are relative to the folder of LIST",
     SUPINE_FILLS(request, states), .file = SUPINE_FILE_IN,
     .partners = "volume allow-folds from as-scanned frame seed vertices inverse image density "
                 "labels rigid"},
    {"samples", 0, "N",
     "write N plausible lungs to -o FILE.safetensors instead of the computed one: all vertices, "
     "positions [N, vertices, 3] in mm and LPS. They are drawn from the expected error, points "
     "near each other with errors alike, and every sample of a surface or a grid has the volumes "
     "of the state. Plan on them as on the computed lungs: what holds in 95 % of them is 95 % "
     "sure. Samples of points inside the lungs have no surface, and their volumes are not exact. "
     "Embedded points are in the order in which they were embedded. Equal options make equal files",
     SUPINE_FILLS(request, samples), SUPINE_SAYS_GIVEN(request, samples_given),
     .range = {1.0, 100000.0}, .partners = "output seed posture gravity volume allow-folds"},
    {"seed", 0, "S", "number that decides the samples: another one draws other lungs",
     SUPINE_FILLS(request, seed), .standard = "0"},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {.table = supine_options_from_scan, SUPINE_FILLS(request, from)},
    {.table = supine_options_as_scanned, SUPINE_FILLS(request, as_scanned)},
    {.table = supine_options_fiducials_frame, SUPINE_FILLS(request, frame)},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {.table = supine_command_deform_content_options, SUPINE_FILLS(request, content)},
    {.name = NULL}};

static const char *frame_of(const supine_frame *frame) {
  if (frame->points != NULL) {
    return ", after a rigid registration at points";
  }
  return frame->hilum ? ", in the frame of the hilum" : "";
}

/* Find the expected errors of a state, its hilum, and its motion in the frame of --frame. */
static supine_status find_errors(const supine_basis *basis, const request *wanted,
                                 supine_deformation *moved, supine_errors *errors,
                                 supine_error *error) {
  SUPINE_TRY(supine_posed_errors(basis, &moved->state, &moved->from.state, errors, error));
  SUPINE_TRY(supine_options_hilum(basis, &moved->state, &moved->from.state, wanted->frame.hilum,
                                  &moved->hilum, error));
  if (wanted->frame.points != NULL) {
    const supine_state *states[2] = {&moved->state, &moved->from.state};
    SUPINE_TRY(supine_options_fiducials(wanted->frame.points, basis, states, errors, moved->motion,
                                        error));
  }
  if (wanted->frame.hilum) {
    SUPINE_TRY(
        supine_options_hilum_errors(basis, &moved->state, &moved->from.state, errors, error));
  }
  if (supine_basis_get_info(basis)->is_fields) {
    SUPINE_TRY(supine_posed_simulator_error(basis, &moved->state, &errors->position, error));
  }
  return SUPINE_OK;
}

static supine_status deform(const supine_basis *basis, const request *wanted, supine_error *error) {
  SUPINE_FREED_BY(supine_posed_errors_free) supine_errors errors = {.moved = {0}};
  SUPINE_ARENA arena = {0};
  supine_deformation moved = {.state = wanted->volume.state,
                              .from_given = wanted->from.given,
                              .allow_folds = wanted->volume.allow_folds,
                              .subtract_hilum = wanted->frame.hilum,
                              .registered = wanted->frame.points != NULL};
  char comment[384 + SUPINE_CAVEATS_SIZE];
  char caveats[SUPINE_CAVEATS_SIZE];
  SUPINE_TRY(supine_options_reference(basis, name, &wanted->from, false, &moved.from, error));
  SUPINE_TRY(supine_options_pose(basis, name, &moved.state, &moved.pose, error));
  supine_options_tell_state(name, basis, &moved.state, &moved.pose);
  if (wanted->sample_given) { /* the expected error of the prediction is not that of a sample */
    const size_t n = supine_basis_get_info(basis)->vertex_count;
    moved.deviation = supine_arena_take(&arena, 3 * n, sizeof *moved.deviation);
    SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", n));
    SUPINE_TRY(supine_command_deform_sample(basis, &moved.state, wanted->seed, wanted->sample,
                                            moved.deviation, error));
  } else {
    SUPINE_TRY(find_errors(basis, wanted, &moved, &errors, error));
  }
  const bool simulated = supine_basis_get_info(basis)->is_fields && errors.position.sigma != NULL;
  moved.errors = errors;
  (void)supine_basis_caveats(basis, caveats, sizeof caveats);
  supine_options_next_result();
  SUPINE_ADD_RESULT(json_pack("{s:s}", "caveats", caveats));
  (void)snprintf(comment, sizeof comment, "displacement from %s%s; %s%s", moved.from.name,
                 frame_of(&wanted->frame),
                 simulated ? "expected_error_mm: of the fit to the other simulator; " : "",
                 caveats);
  moved.save.comment = comment;
  SUPINE_TRY(supine_options_basis_frame(basis, wanted->as_scanned, &moved.save, error));
  return supine_command_deform_content(&wanted->content, basis, &moved, error);
}

/* Fill a request with the state and the output file in a row of the CSV file of --states. */
static supine_status read_row(const supine_csv *csv, request *row, supine_error *error) {
  const char *const output = supine_csv_text(csv, 1);
  const char *const volume = supine_csv_text(csv, 4);
  supine_state *state = &row->volume.state;
  supine_error reason;
  supine_state posture = {.gravity = {0.0, 1.0, 0.0}}; /* the default posture is supine */
  supine_state own = {.lung_count = 0};                /* the volume in the row */
  supine_status status = supine_state_parse(supine_csv_text(csv, 0), &posture, &reason);
  if (status == SUPINE_OK && volume != NULL && volume[0] != '\0') {
    status = supine_state_parse_volume(volume, &own, &reason);
  }
  if (status == SUPINE_OK) {
    status = supine_state_join(&posture, &own, &posture, &reason);
  }
  if (status == SUPINE_OK && supine_state_join(&posture, state, state, NULL) != SUPINE_OK) {
    *state = posture; /* the option's volume is for rows without one */
  }
  if (status != SUPINE_OK) {
    return supine_error_wrap(error, &reason, "%s:%zu: ", csv->path, csv->line);
  }
  const char *const sample = supine_csv_text(csv, 5);
  if (sample != NULL && sample[0] != '\0') {
    row->sample_given = true;
    const bool whole = supine_options_parse_count(sample, &row->sample);
    SUPINE_REFUSE_IF(!whole, error, SUPINE_ERROR_ARGUMENT,
                     "%s:%zu: sample '%s': give a whole number from 0 on", csv->path, csv->line,
                     sample);
    SUPINE_REFUSE_IF(row->frame.hilum || row->frame.points != NULL, error, SUPINE_ERROR_UNSUPPORTED,
                     "%s:%zu: samples are in the frame of the body: leave --frame out", csv->path,
                     csv->line);
  }
  const bool voxels = supine_image_supports(output);
  const bool image = row->content.image != NULL || row->content.labels != NULL;
  SUPINE_REFUSE_IF(!voxels && !supine_mesh_save_supports(output) &&
                       !supine_text_ends_in(output, ".csv") &&
                       !supine_options_markups_named(output),
                   error, SUPINE_ERROR_ARGUMENT, "%s:%zu: %s: the name must end in %s", csv->path,
                   csv->line, output, ENDINGS);
  for (size_t i = 0; i < 3; ++i) { /* the columns output, labels and field */
    const char *const named = supine_csv_text(csv, 1 + i);
    if (named != NULL && named[0] != '\0') {
      row->outputs[i] = supine_path_beside(csv->path, named);
      if (row->outputs[i] == NULL) {
        return SUPINE_ERROR_MEMORY;
      }
    }
  }
  row->content.labels_path = row->outputs[1];
  row->content.field = row->outputs[2];
  if (voxels && !image) {
    row->content.field = row->outputs[0];
  } else {
    row->content.path = row->outputs[0];
  }
  return supine_command_deform_content_check(&row->content, error);
}

/* Check that one output of the last request can be written, and is neither an input nor an earlier
 * output. */
static supine_status check_output(const char *basis, const request *rows, size_t count,
                                  size_t which, supine_error *error) {
  const request *row = &rows[count - 1];
  const char *const output = row->outputs[which];
  const char *const inputs[] = {basis, row->states, row->content.image, row->content.labels};
  for (size_t i = 0; i < sizeof inputs / sizeof *inputs; ++i) {
    if (inputs[i] != NULL) {
      SUPINE_TRY(supine_options_check_output(output, inputs[i], error));
    }
  }
  for (size_t i = 0; i < 3 * (count - 1) + which; ++i) {
    const char *const earlier = rows[i / 3].outputs[i % 3];
    SUPINE_REFUSE_IF(earlier != NULL && strcmp(earlier, output) == 0, error, SUPINE_ERROR_ARGUMENT,
                     "%s: two rows write %s: give each row its own file", row->states, output);
  }
  return supine_output_try(output, error);
}

/* What a run needs: the basis, and a request for each state. */
typedef struct batch {
  request *wanted;
  supine_basis *basis;
  request *rows;
  size_t count;
  supine_deform_tissue tissue; /* of the image */
} batch;

static void end(batch *b) {
  for (size_t i = 0; i < 3 * b->count; ++i) {
    free(b->rows[i / 3].outputs[i % 3]);
  }
  free(b->rows);
  supine_warp_tissue_free(&b->tissue.soft);
  supine_image_free(&b->wanted->content.source);
  supine_image_free(&b->wanted->content.label_source);
  supine_basis_close(b->basis);
}

static supine_status add_row(batch *b, supine_error *error) {
  request *grown = realloc(b->rows, (b->count + 1) * sizeof *grown);
  if (grown == NULL) {
    return supine_error_memory(error, "%zu states", b->count + 1);
  }
  b->rows = grown;
  grown[b->count++] = *b->wanted;
  return SUPINE_OK;
}

/* Make a request for each row of --states, and check all rows before any state is computed. */
static supine_status read_rows(const char *basis, batch *b, supine_error *error) {
  static const char *const columns[] = {"posture", "output", "labels", "field", "volume", "sample"};
  SUPINE_FREED_BY(supine_csv_close) supine_csv csv = {0};
  SUPINE_TRY(supine_csv_open(b->wanted->states, columns, 6, 2, &csv, error));
  for (;;) {
    bool more = false;
    SUPINE_TRY(supine_csv_next(&csv, &more, error));
    if (!more) {
      break;
    }
    SUPINE_TRY(add_row(b, error));
    SUPINE_TRY(read_row(&csv, &b->rows[b->count - 1], error));
    for (size_t i = 0; i < 3; ++i) {
      if (b->rows[b->count - 1].outputs[i] != NULL) {
        SUPINE_TRY(check_output(basis, b->rows, b->count, i, error));
      }
    }
  }
  SUPINE_REFUSE_IF(b->count == 0, error, SUPINE_ERROR_ARGUMENT,
                   "%s: no row follows the header: add at least one", b->wanted->states);
  return SUPINE_OK;
}

/* Check the output file and the options of a single state. */
static supine_status check_samples(const request *wanted, supine_error *error) {
  SUPINE_TRY(
      supine_command_deform_samples_check(wanted->content.path, wanted->samples_given, error));
  return wanted->samples_given ? SUPINE_OK
                               : supine_command_deform_content_check(&wanted->content, error);
}

/* Write samples of a state. */
static supine_status draw(const supine_basis *basis, const request *wanted, supine_error *error) {
  supine_state state = wanted->volume.state;
  const supine_deform_samples samples = {.path = wanted->content.path,
                                         .count = wanted->samples,
                                         .seed = wanted->seed,
                                         .basis = basis,
                                         .state = &state};
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  double distance = 0.0;
  bool held = false;
  char text[160];
  supine_pose pose;
  SUPINE_TRY(supine_options_pose(basis, name, &state, &pose, error));
  supine_options_tell_state(name, basis, &state, &pose);
  SUPINE_TRY(supine_command_deform_samples(&samples, &distance, &held, error));
  (void)supine_state_describe(&state, text, sizeof text);
  SUPINE_ADD_RESULT(json_pack("{s:o, s:I, s:I, s:s, s:I, s:f}", "file",
                              supine_options_json_text(samples.path), "samples",
                              (json_int_t)samples.count, "points", (json_int_t)n, "state", text,
                              "seed", (json_int_t)samples.seed, "distance_rms_mm", distance));
  supine_options_line("%s: %zu sample%s of %zu point%s, %s, seed %zu: %.1f mm (RMS) from the "
                      "prediction%s\n",
                      samples.path, samples.count, samples.count == 1 ? "" : "s", n,
                      n == 1 ? "" : "s", text, samples.seed, distance,
                      held ? ", each with the volumes of the state" : "");
  return SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  request *wanted = chosen;
  SUPINE_FREED_BY(end) batch b = {.wanted = wanted};
  if (wanted->states != NULL) {
    SUPINE_TRY(read_rows(given->operand[0], &b, error));
  } else {
    SUPINE_TRY(check_samples(wanted, error));
    SUPINE_TRY(supine_options_state(&wanted->orientation, &wanted->volume.state, error));
    SUPINE_TRY(add_row(&b, error));
  }
  SUPINE_TRY(supine_options_basis_open(given->operand[0], SUPINE_STORAGE_EXACT,
                                       wanted->volume.allow_folds, &b.basis, error));
  SUPINE_TRY(supine_command_deform_content_read(&wanted->content, name, error));
  for (size_t i = 0; i < b.count; ++i) {
    b.rows[i].content.source = wanted->content.source;
    b.rows[i].content.label_source = wanted->content.label_source;
    b.rows[i].content.tissue = &b.tissue;
    if (wanted->samples_given) {
      SUPINE_TRY(draw(b.basis, &b.rows[i], error));
    } else {
      SUPINE_TRY(deform(b.basis, &b.rows[i], error));
    }
  }
  return SUPINE_OK;
}

const supine_command supine_command_deform = {
    name,
    "deform a basis for a posture and a volume",
    .usage = "BASIS --posture STATE -o FILE\n"
             "BASIS --states LIST",
    .about =
        "Deforms the lungs of a basis file to a posture and a volume, as the run-time library "
        "does in each frame, and writes the surface. Each point has the expected error "
        "of its position, expected_error_mm; the same on another day than that of the scan, "
        "another_day_error_mm; and that of its displacement, moved_error_mm, which counts from "
        "the state of --from. Each is " SUPINE_EXPECTED_MEANING ". " SUPINE_EXPECTED_SUPPORT
        "\nOn a surface made with --fields, expected_error_mm is the error of the fit to the other "
        "simulator, larger in gaps between its directions of gravity.",
    .options = table,
    .notes =
        "Examples:\n"
        "  supine deform lungs.safetensors --posture prone:rest+500 -o prone.vtp\n"
        "  supine deform lungs.safetensors --gravity 0.6,0,-0.8 --volume left=rest,right=rest+250 "
        "-o out.ply\n"
        "  supine deform nodules.safetensors --posture prone --from supine:rest -o nodules.csv\n"
        "  supine deform grid.safetensors --posture prone --image ct.nii.gz --density -o "
        "prone.nii.gz\n"
        "  supine deform grid.safetensors --states list.csv --image ct.nii.gz --density",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
