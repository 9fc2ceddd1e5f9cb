/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The library: from options to a basis in memory, with a report and what was found in the input. */
#include <cblas.h>
#include <gsl/gsl_errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/facts.h>
#include <supine/inputs.h>
#include <supine/precompute.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/remedy.h"
#include "precompute/fields/check.h"
#include "precompute/library.h"

enum { BAND = 23, MODES = 16 }; /* defaults */

/* Choose what the basis contains. */
static supine_status choose(const supine_precompute_modes *wanted, bool is_fields,
                            supine_basis_choice *choice, supine_error *error) {
  const bool has_band = wanted->has_band || wanted->band > 0;
  const bool has_modes = wanted->harmonics || wanted->count > 0;
  const size_t standard = is_fields ? SUPINE_MODES_MADE_MAX : MODES;
  SUPINE_REFUSE_IF(wanted->harmonics && wanted->count > 0, error, SUPINE_ERROR_ARGUMENT,
                   "give a number of modes or harmonics, not both");
  *choice = (supine_basis_choice){.band = has_band ? wanted->band : BAND,
                                  .modes = standard,
                                  .held_out = wanted->held_out,
                                  .without_normals = wanted->without_normals,
                                  .choose_band = is_fields && !has_band,
                                  .keep_modes = is_fields && has_modes,
                                  .storage = (supine_warp_storage)wanted->storage};
  if (has_modes) {
    choice->modes = wanted->count; /* 0: harmonics */
  }
  return SUPINE_OK;
}

static void fill_report(const supine_prepared *prepared, const supine_basis_report *made,
                        supine_precompute_report *report) {
  const supine_lungs *lungs = &prepared->source.lungs;
  const supine_accuracy *accuracy = &made->accuracy;
  const bool rest_known = prepared->reference.known;
  *report = (supine_precompute_report){
      .lung_count = lungs->lung_count,
      .vertex_count = lungs->mesh.vertex_count,
      .band = made->band,
      .mode_count = made->mode_count,
      .direction_count = accuracy->direction_count,
      .relative = {accuracy->relative_rms, accuracy->relative_p95, accuracy->relative_max},
      .mm = {accuracy->rms_mm, accuracy->p95_mm, accuracy->max_mm},
      .rest_known = rest_known,
      .rest_part = rest_known ? accuracy->volume : 0.0,
      .volume = rest_known ? 0.0 : accuracy->volume,
      .turned_over = made->turned_over,
      .turning_rms = accuracy->turning_rms};
}

/* Read another simulator's fields, and question them.
 * @param motion  written: how large the displacements are */
static supine_status load_fields(const char *path, const supine_source *source,
                                 supine_findings *findings, supine_fields *fields,
                                 supine_fields_motion *motion, supine_error *error) {
  SUPINE_TRY(supine_fields_load(path, &source->lungs, &source->frame, fields, error));
  return supine_fields_check(path, fields, &source->lungs, findings, motion, error);
}

static void report_fields(const supine_basis_report *made, const supine_fields_motion *motion,
                          supine_precompute_report *report) {
  report->band_count = made->fit.band_highest + 1;
  memcpy(report->band_error, made->fit.error[made->fit.order], sizeof report->band_error);
  report->direction_count = made->fit.direction_count;
  report->volume_count = made->fit.volume_count;
  report->order = made->fit.order;
  report->extrapolated = made->fit.extrapolated;
  report->cluster_count = made->cluster_count;
  report->volume_error = made->fit.volume_error;
  report->six_volumes = made->fit.six_volumes;
  report->displacement = motion->rms_mm;
  report->along_gravity = motion->along_mm;
  memcpy(report->nearest_supine, motion->nearest, sizeof report->nearest_supine);
}

void supine_precompute_report_state(const supine_precompute_report *report, char *text,
                                    size_t size) {
  if (!report->rest_known) {
    (void)supine_print_text(text, size, "%g mL", report->volume);
  } else if (report->rest_part == 1.0) {
    (void)snprintf(text, size, "rest");
  } else {
    (void)supine_print_text(text, size, "%g of the volume change from full to rest",
                            report->rest_part);
  }
}

/* Warn if the surface folds in one of six postures. */
static void tell_folds(const supine_prepared *prepared, const supine_precompute_report *report,
                       supine_findings *findings) {
  char state[64];
  if (supine_input_judge(SUPINE_INPUT_FOLDS, report->turned_over) == SUPINE_INPUT_TAKEN) {
    return;
  }
  const bool links = prepared->model.reach == 0.0;
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {links ? supine_remedy_give("reach", "10", "")
                                                           : supine_remedy_change("gain", ""),
                                                     supine_remedy_change("reach", "")};
  supine_precompute_report_state(report, state, sizeof state);
  supine_findings_warn(
      findings,
      "the surface folds: %.3g %% of its triangles turn over at %s in the worst of six postures%s",
      100.0 * report->turned_over, state,
      links ? ", as forces spread over a few mesh links, however short" : "");
  supine_findings_advise(findings, advice);
}

supine_status supine_precompute_make(const supine_precompute_options *options,
                                     const supine_prepared *prepared, supine_findings *findings,
                                     supine_bytes *bytes, supine_precompute_report *report,
                                     supine_error *error) {
  supine_precompute_options told = *options; /* of the progress */
  SUPINE_FREED_BY(supine_fields_free) supine_fields fields = {0};
  supine_fields_motion motion;
  supine_basis_choice choice;
  supine_basis_report made;
  SUPINE_TRY(choose(&options->modes, options->fields != NULL, &choice, error));
  choice.made_by = options->made_by;
  choice.progress = supine_precompute_go_on;
  choice.progress_context = &told;
  if (options->fields != NULL) {
    SUPINE_TRY(load_fields(options->fields, &prepared->source, findings, &fields, &motion, error));
    choice.fields = &fields;
    choice.scan_gravity = prepared->posture.known ? prepared->posture.state.gravity : NULL;
  }
  SUPINE_TRY(supine_precompute(prepared, &choice, bytes, &made, error));
  fill_report(prepared, &made, report);
  if (options->fields != NULL) {
    SUPINE_TRY(supine_fields_check_fit(options->fields, &made.fit, findings, error));
    report_fields(&made, &motion, report);
  } else {
    tell_folds(prepared, report, findings);
  }
  return SUPINE_OK;
}

/* Settings of the process that are changed while at least one basis is being made. */
static struct {
  pthread_mutex_t lock;
  size_t makers; /* number of bases being made */
  gsl_error_handler_t *handler;
  int blas_threads;
} process = {.lock = PTHREAD_MUTEX_INITIALIZER};

/* Let GSL return its errors, and OpenBLAS use one thread: its threads would wait busily beside
 * those of this library. The first of several calls keeps the settings of the process. */
static void process_enter(void) {
  (void)pthread_mutex_lock(&process.lock);
  if (process.makers++ == 0) {
    process.handler = gsl_set_error_handler_off();
    process.blas_threads = openblas_get_num_threads();
    openblas_set_num_threads(1);
  }
  (void)pthread_mutex_unlock(&process.lock);
}

static void process_leave(void) {
  (void)pthread_mutex_lock(&process.lock);
  if (--process.makers == 0) {
    openblas_set_num_threads(process.blas_threads);
    (void)gsl_set_error_handler(process.handler);
  }
  (void)pthread_mutex_unlock(&process.lock);
}

/* A result and its memory. */
typedef struct owned {
  supine_precompute_result result; /* first, so that its address is that of the struct */
  supine_bytes bytes;
  supine_arena memory;
  supine_findings findings;
} owned;

/* The progress of one of the two steps: the lungs, and the basis. */
typedef struct step {
  const supine_precompute_options *options;
  double before, share; /* fraction of the work before the step, and its share */
} step;

static int tell(void *context, double fraction) {
  const step *s = context;
  const supine_precompute_options *options = s->options;
  if (options->progress == NULL) {
    return 0;
  }
  return options->progress(options->context, s->before + s->share * fraction);
}

/* Copy the first `length` bytes of a text; return "" if memory is short. */
static const char *copy(supine_arena *memory, const char *text, size_t length) {
  char *made = supine_arena_zeros(memory, length + 1, 1);
  if (made == NULL) {
    return "";
  }
  memcpy(made, text, length);
  return made;
}

/* List what the basis assumes and was given: its facts, a line each. */
static supine_status list_facts(owned *to, supine_error *error) {
  supine_basis *basis = NULL;
  supine_fact facts[SUPINE_FACTS_MAX];
  SUPINE_TRY(supine_basis_open_memory(to->bytes.data, to->bytes.size, &basis, error));
  const size_t count = supine_basis_facts(basis, facts);
  const char **list = supine_arena_zeros(&to->memory, count, sizeof *list);
  if (list != NULL) {
    for (size_t i = 0; i < count; ++i) {
      char value[320];
      char line[400];
      (void)supine_fact_print(&facts[i], value, sizeof value);
      const int length = snprintf(line, sizeof line, "%s: %s", facts[i].name, value);
      list[i] = copy(&to->memory, line, (size_t)length);
    }
  }
  supine_basis_close(basis);
  to->result.assumptions = list;
  to->result.assumption_count = count;
  return supine_arena_check(&to->memory, error, "%zu facts", count);
}

static supine_status make(const supine_precompute_options *options, owned *to,
                          supine_error *error) {
  static const double loading = 0.3; /* share of the work that reads a label map, assumed */
  SUPINE_FREED_BY(supine_precompute_prepared_free) supine_prepared prepared = {.fit = ""};
  const step lungs = {options, 0.0, loading};
  const step basis = {options, loading, 1.0 - loading};
  supine_precompute_options told = *options;
  told.progress = tell;
  told.context = (void *)&lungs; /* only read */
  supine_status status = supine_precompute_prepare(&told, &prepared, error);
  if (status == SUPINE_OK) {
    told.context = (void *)&basis;
    status = supine_precompute_make(&told, &prepared, &prepared.source.findings, &to->bytes,
                                    &to->result.report, error);
  }
  to->findings = prepared.source.findings;
  SUPINE_TRY(status);
  SUPINE_TRY(list_facts(to, error));
  to->result.bytes = to->bytes.data;
  to->result.size = to->bytes.size;
  return supine_arena_check(&to->memory, error, "a report");
}

supine_status supine_precompute_basis(const supine_precompute_options *options,
                                      supine_precompute_result **result, supine_error *error) {
  /* Programs that were built with an earlier header have a shorter struct. */
  const size_t oldest = offsetof(supine_precompute_options, context) + sizeof options->context;
  supine_precompute_options given = {.size = 0};
  owned *to = calloc(1, sizeof *to);
  *result = NULL;
  if (to == NULL) {
    return supine_error_memory(error, "a basis");
  }
  *result = &to->result;
  to->result.findings = &to->findings;
  SUPINE_REFUSE_IF(options->size < oldest, error, SUPINE_ERROR_ARGUMENT,
                   "the size of the options is %zu: set it to sizeof(supine_precompute_options)",
                   options->size);
  memcpy(&given, options, options->size < sizeof given ? options->size : sizeof given);
  process_enter();
  const supine_status status = make(&given, to, error);
  process_leave();
  return status;
}

void supine_precompute_result_free(supine_precompute_result *result) {
  owned *from = (owned *)result;
  if (from != NULL) {
    free(from->bytes.data);
    supine_arena_free(&from->memory);
    free(from);
  }
}
