/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine pv: fit a lung's pressure-volume relation to samples, or print a relation. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <jansson.h>

#include "base/arena.h"
#include "base/blas.h"
#include "base/locale.h"
#include "base/output.h"

#include "program/command/list.h"
#include "program/options/command.h"
#include "program/options/pv.h"

static const char command[] = "pv";

static const double confidence = 0.95; /* level of the intervals */

typedef struct request {
  const char *output;
  double step;
} request;

static const supine_option table[] = {
    {"output", 'o', "FILE",
     "JSON file of the parameters and the report, for --pv of 'supine breathe'",
     SUPINE_FILLS(request, output), .file = SUPINE_FILE_OUT},
    {"step", 's', "CMH2O", "for 'show': step of pressure", SUPINE_FILLS(request, step),
     .standard = "1", SUPINE_ABOVE_ZERO, SUPINE_MEASURES(PRESSURE)},
    {.name = NULL}};

static json_t *json_limb(const supine_pv_curve *curve, const supine_pv_report *report) {
  return json_pack(
      "{s:I, s:o, s:o, s:o, s:o, s:o, s:f, s:f}", "samples", (json_int_t)report->samples,
      "pressure_cmH2O", supine_options_json_numbers(2, curve->pressure), "volume_mL",
      supine_options_json_numbers(2, curve->volume), "volume_interval_mL",
      supine_options_json_numbers(2, report->volume_interval), "control",
      supine_options_json_numbers(SUPINE_PV_CONTROLS, curve->control), "control_interval",
      supine_options_json_numbers(SUPINE_PV_CONTROLS, report->control_interval), "rms_mL",
      report->rms, "rms_percent", report->rms_percent);
}

static supine_status run_fit(const char *path, const request *chosen, supine_error *error) {
  SUPINE_C_LOCALE;
  supine_pv pv = {0};
  supine_pv_report reports[SUPINE_PV_LIMB_COUNT];
  SUPINE_TRY(supine_blas_reserve(1, error)); /* the fit of many samples uses it */
  SUPINE_TRY(supine_options_pv_fit_file(path, confidence, &pv, reports, error));
  json_auto_t *root = json_pack("{s:f}", "confidence", confidence);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    const char *name = supine_breath_limb_name((supine_pv_limb)limb);
    if (reports[limb].rms_percent > 1.0) {
      supine_options_note(command, "the %s samples deviate from their curve by %.2g %% RMS", name,
                          reports[limb].rms_percent);
    }
    if (reports[limb].samples > 0) {
      (void)json_object_set_new(root, name, json_limb(&pv.limb[limb], &reports[limb]));
    }
  }
  supine_options_print(json_incref(root));
  if (chosen->output == NULL) {
    return SUPINE_OK;
  }
  supine_output output; /* written last, so that a failure leaves no file */
  SUPINE_TRY(supine_output_open(chosen->output, &output, error));
  (void)json_dumpf(root, output.file, JSON_INDENT(2));
  return supine_output_commit(&output, error);
}

static supine_status add_row(const supine_pv *pv, double pressure, json_t *rows,
                             supine_error *error) {
  json_t *row = json_pack("{s:f}", "pressure_cmH2O", pressure);
  (void)json_array_append_new(rows, row);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    const supine_pv_curve *curve = &pv->limb[limb];
    const char *const name = supine_breath_limb_name((supine_pv_limb)limb);
    double volume = (double)NAN;
    double compliance = (double)NAN;
    if (pressure >= curve->pressure[0] && pressure <= curve->pressure[1]) {
      SUPINE_TRY(supine_breath_curve_evaluate(curve, 1, &pressure, &volume, &compliance, error));
    }
    char key[40];
    (void)snprintf(key, sizeof key, "%s_mL", name);
    (void)json_object_set_new(row, key, supine_options_json_number(volume));
    (void)snprintf(key, sizeof key, "%s_mL_per_cmH2O", name);
    (void)json_object_set_new(row, key, supine_options_json_number(compliance));
  }
  return SUPINE_OK;
}

static supine_status run_show(const char *path, const request *chosen, supine_error *error) {
  enum { ROWS_MAX = 1000000 };
  supine_pv pv = *supine_breath_normal();
  if (path != NULL) {
    SUPINE_TRY(supine_options_pv_load(path, &pv, error));
  }
  const double low = fmin(pv.limb[0].pressure[0], pv.limb[1].pressure[0]);
  const double high = fmax(pv.limb[0].pressure[1], pv.limb[1].pressure[1]);
  const double steps = (high - low) / chosen->step;
  SUPINE_REFUSE_IF(!(steps < ROWS_MAX), error, SUPINE_ERROR_ARGUMENT,
                   "--step gives more than %d rows: give a larger step", ROWS_MAX);
  json_auto_t *rows = json_array();
  for (size_t j = 0; (double)j < steps * (1.0 - 1e-12); ++j) {
    SUPINE_TRY(add_row(&pv, low + (double)j * chosen->step, rows, error));
  }
  SUPINE_TRY(add_row(&pv, high, rows, error));
  supine_options_print_rows(json_incref(rows), 7);
  return SUPINE_OK;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  const char *verb = given->operand[0];
  const char *file = given->count > 1 ? given->operand[1] : NULL;
  if (strcmp(verb, "show") == 0) {
    return run_show(file, chosen, error);
  }
  if (strcmp(verb, "fit") == 0 && file != NULL) {
    return run_fit(file, chosen, error);
  }
  return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                          "give 'fit FILE' or 'show [FILE]', not '%s'", verb);
}

const supine_command supine_command_pv = {
    command,
    "fit a pressure-volume relation to samples, or print one",
    .usage = "fit SAMPLES.csv [-o FILE] [--json]\n"
             "show [FILE] [--step CMH2O]",
    .about = "Fits a lung's pressure-volume relation to samples, for 'supine breathe --pv FILE', "
             "or prints a relation.\n"
             "\n"
             "fit determines the five control parameters of each limb, their 95 % confidence "
             "intervals, and the residual of the samples (RMS, in mL and as a percentage of the "
             "range of volumes).\n"
             "\n"
             "show prints volume and compliance against pressure as CSV; without FILE, it prints "
             "the built-in relation of a normal adult lung.\n"
             "\n"
             "SAMPLES.csv has one sample per line; pressures in a limb only rise or only fall:\n"
             "\n"
             "      # static manoeuvre; lines like this one are comments\n"
             "      pressure_cmH2O,volume_mL,limb\n"
             "      0,2250,inhale\n"
             "      2.5,2390,inhale\n"
             "      ...\n"
             "      30,5980,exhale\n"
             "\n"
             "Without the column limb, all samples belong to the inhale limb. A limb needs at "
             "least 8 samples, or 20 if their noise is 1 % of the range of volumes; a limb without "
             "samples takes the curve of the other limb. Volumes may be absolute or relative to "
             "any reference, as only their differences are used.",
    .options = table,
    .notes =
        "Each limb has its own model, V'' = u V'. V is the volume as a function of x, the pressure "
        "scaled so that the limb's samples span -1 to 1; u = c1 P0(x) + ... + c5 P4(x), with the "
        "Legendre polynomials P0 to P4. V' is the compliance, and u is its relative rate of "
        "change: c1 < 0 stiffens the lung towards high pressure, c2 < 0 puts the greatest "
        "compliance in the middle (a sigmoid), c3 skews the sigmoid, c4 and c5 sharpen its knees.\n"
        "\n"
        "Examples:\n"
        "  supine pv fit patient.csv -o patient.pv.json\n"
        "  supine breathe lungs.safetensors --posture supine --pv patient.pv.json -o breath.vtp\n"
        "  supine pv show patient.pv.json --step 0.5 > curve.csv",
    .operands_least = 1,
    .operands_most = 2,
    .operands_missing = "give 'fit FILE' or 'show [FILE]'",
    .request_size = sizeof(request),
    .run = run};
