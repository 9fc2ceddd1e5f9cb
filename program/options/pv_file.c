/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read samples of a pressure-volume relation, and read and write its parameters, as CSV. */
#include <stdlib.h>
#include <string.h>

#include "sh/base/csv.h"
#include "sh/base/output.h"

#include "program/options/pv.h"

/* Read the limb that a column names; inhale where the file has no such column. */
static supine_status read_limb(const supine_csv *csv, size_t column, supine_pv_limb *limb,
                               supine_error *error) {
  const char *text = supine_csv_text(csv, column);
  *limb = SUPINE_PV_INHALE;
  if (text == NULL || strcmp(text, supine_breath_limb_name(SUPINE_PV_INHALE)) == 0) {
    return SUPINE_OK;
  }
  *limb = SUPINE_PV_EXHALE;
  if (strcmp(text, supine_breath_limb_name(SUPINE_PV_EXHALE)) == 0) {
    return SUPINE_OK;
  }
  return supine_error_set(error, SUPINE_ERROR_FORMAT,
                          "%s:%zu: limb \"%s\" is unknown: give inhale or exhale", csv->path,
                          csv->line, text);
}

/* The samples of a limb, in the file's order. */
typedef struct samples {
  size_t count;
  supine_pv_sample *sample;
} samples;

static supine_status add_sample(const supine_csv *csv, const char *const *names, samples *limbs,
                                supine_error *error) {
  supine_pv_limb limb = SUPINE_PV_INHALE;
  supine_pv_sample sample = {.line = csv->line};
  supine_status status = read_limb(csv, 2, &limb, error);
  if (status == SUPINE_OK) {
    status = supine_csv_number(csv, 0, names[0], &sample.pressure, error);
  }
  if (status == SUPINE_OK) {
    status = supine_csv_number(csv, 1, names[1], &sample.volume, error);
  }
  if (status != SUPINE_OK) {
    return status;
  }
  samples *into = &limbs[limb];
  supine_pv_sample *grown = reallocarray(into->sample, into->count + 1, sizeof *grown);
  if (grown == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  into->sample = grown;
  into->sample[into->count++] = sample;
  return SUPINE_OK;
}

static supine_status load_samples(const char *path, samples *limbs, supine_error *error) {
  static const char *const names[] = {"pressure_cmH2O", "volume_mL", "limb"};
  supine_csv csv = {0};
  supine_status status = supine_csv_open(path, names, 3, 2, &csv, error);
  for (bool more = true; status == SUPINE_OK && more;) {
    status = supine_csv_next(&csv, &more, error);
    if (status == SUPINE_OK && more) {
      status = add_sample(&csv, names, limbs, error);
    }
  }
  supine_csv_close(&csv);
  return status;
}

supine_status supine_breath_fit_file(const char *path, double confidence, supine_pv *pv,
                                     supine_pv_report *reports, supine_error *error) {
  samples limbs[SUPINE_PV_LIMB_COUNT] = {{0}};
  supine_status status = load_samples(path, limbs, error);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT && status == SUPINE_OK; ++limb) {
    const samples *of = &limbs[limb];
    reports[limb] = (supine_pv_report){0};
    if (of->count > 0 || limbs[1 - limb].count == 0) {
      status = supine_breath_fit(path, of->count, of->sample, confidence, &pv->limb[limb],
                                 &reports[limb], error);
    }
  }
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    if (limbs[limb].count == 0) {
      pv->limb[limb] = pv->limb[1 - limb];
    }
    free(limbs[limb].sample);
  }
  return status;
}

static const char *const parameter_names[] = {"limb",
                                              "pressure_low_cmH2O",
                                              "pressure_high_cmH2O",
                                              "volume_low_mL",
                                              "volume_high_mL",
                                              "c1",
                                              "c2",
                                              "c3",
                                              "c4",
                                              "c5"};
enum { PARAMETER_COUNT = sizeof parameter_names / sizeof *parameter_names };

supine_status supine_breath_save(const char *path, const supine_pv *pv, supine_error *error) {
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    const supine_status status = supine_breath_curve_check(&pv->limb[limb], error);
    if (status != SUPINE_OK) {
      return status;
    }
  }
  supine_output output;
  const supine_status status = supine_output_open(path, &output, error);
  if (status != SUPINE_OK) {
    return status;
  }
  (void)fputs("# Supine pressure-volume parameters: V'' = (c1 P0(x) + ... + c5 P4(x)) V',\n"
              "# x from -1 to 1 over the pressures, P0 to P4 Legendre polynomials.\n",
              output.file);
  for (int c = 0; c < PARAMETER_COUNT; ++c) {
    (void)fprintf(output.file, "%s%s", c == 0 ? "" : ",", parameter_names[c]);
  }
  (void)fputc('\n', output.file);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    const supine_pv_curve *curve = &pv->limb[limb];
    (void)fprintf(output.file, "%s,%.17g,%.17g,%.17g,%.17g",
                  supine_breath_limb_name((supine_pv_limb)limb), curve->pressure[0],
                  curve->pressure[1], curve->volume[0], curve->volume[1]);
    for (int i = 0; i < SUPINE_PV_CONTROLS; ++i) {
      (void)fprintf(output.file, ",%.17g", curve->control[i]);
    }
    (void)fputc('\n', output.file);
  }
  return supine_output_commit(&output, error);
}

/* Read a row of parameters; `seen` marks the limbs that the file has. */
static supine_status parameters_add(const supine_csv *csv, supine_pv *pv, bool *seen,
                                    supine_error *error) {
  supine_pv_limb limb = SUPINE_PV_INHALE;
  supine_status status = read_limb(csv, 0, &limb, error);
  double number[PARAMETER_COUNT] = {0};
  for (size_t c = 1; c < PARAMETER_COUNT && status == SUPINE_OK; ++c) {
    status = supine_csv_number(csv, c, parameter_names[c], &number[c], error);
  }
  if (status != SUPINE_OK) {
    return status;
  }
  if (seen[limb]) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s:%zu: a second row for %s: keep one",
                            csv->path, csv->line, supine_breath_limb_name(limb));
  }
  seen[limb] = true;
  supine_pv_curve *curve = &pv->limb[limb];
  memcpy(curve->pressure, number + 1, sizeof curve->pressure);
  memcpy(curve->volume, number + 3, sizeof curve->volume);
  memcpy(curve->control, number + 5, sizeof curve->control);
  supine_error why;
  if (supine_breath_curve_check(curve, &why) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s:%zu: %.300s", csv->path, csv->line,
                            why.message);
  }
  return SUPINE_OK;
}

supine_status supine_breath_load(const char *path, supine_pv *pv, supine_error *error) {
  supine_pv found = {0};
  bool seen[SUPINE_PV_LIMB_COUNT] = {false};
  supine_csv csv = {0};
  supine_status status =
      supine_csv_open(path, parameter_names, PARAMETER_COUNT, PARAMETER_COUNT, &csv, error);
  for (bool more = true; more && status == SUPINE_OK;) {
    status = supine_csv_next(&csv, &more, error);
    if (status == SUPINE_OK && more) {
      status = parameters_add(&csv, &found, seen, error);
    }
  }
  supine_csv_close(&csv);
  if (status != SUPINE_OK) {
    return status;
  }
  if (!seen[SUPINE_PV_INHALE] && !seen[SUPINE_PV_EXHALE]) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: no row of parameters: make the file with 'supine pv fit'", path);
  }
  *pv = found;
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    if (!seen[limb]) {
      pv->limb[limb] = found.limb[1 - limb];
    }
  }
  return SUPINE_OK;
}
