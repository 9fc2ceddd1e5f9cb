/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Files: samples in, parameters out and in. */
#include <stdlib.h>
#include <string.h>

#include "sh/base/output.h"

#include "program/breath/pv_internal.h"

/* Which limb the column names; inhale where the file has no such column. */
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

static supine_status grow(void **array, size_t count, size_t size) {
  void *larger = reallocarray(*array, count, size);
  if (larger == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  *array = larger;
  return SUPINE_OK;
}

/* Room for one more: arrays double when their count reaches a power of two. */
static supine_status samples_reserve(supine_pv_samples *samples, supine_pv_limb limb,
                                     supine_error *error) {
  const size_t count = samples->count[limb];
  if ((count & (count - 1)) != 0) {
    return SUPINE_OK;
  }
  const size_t room = count == 0 ? 1 : 2 * count;
  if (grow((void **)&samples->pressure[limb], room, sizeof(double)) != SUPINE_OK ||
      grow((void **)&samples->volume[limb], room, sizeof(double)) != SUPINE_OK ||
      grow((void **)&samples->line[limb], room, sizeof(size_t)) != SUPINE_OK) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
  return SUPINE_OK;
}

static supine_status samples_add(const supine_csv *csv, const char *const *names,
                                 supine_pv_samples *samples, supine_error *error) {
  supine_pv_limb limb = SUPINE_PV_INHALE;
  double pressure = 0.0;
  double volume = 0.0;
  supine_status status = read_limb(csv, 2, &limb, error);
  if (status == SUPINE_OK) {
    status = supine_csv_number(csv, 0, names[0], &pressure, error);
  }
  if (status == SUPINE_OK) {
    status = supine_csv_number(csv, 1, names[1], &volume, error);
  }
  if (status == SUPINE_OK) {
    status = samples_reserve(samples, limb, error);
  }
  if (status == SUPINE_OK) {
    const size_t j = samples->count[limb]++;
    samples->pressure[limb][j] = pressure;
    samples->volume[limb][j] = volume;
    samples->line[limb][j] = csv->line;
  }
  return status;
}

supine_status supine_breath_samples_load(const char *path, supine_pv_samples *samples,
                                         supine_error *error) {
  static const char *const names[] = {"pressure_cmH2O", "volume_mL", "limb"};
  *samples = (supine_pv_samples){0};
  supine_csv csv = {0};
  supine_status status = supine_csv_open(path, names, 3, 2, &csv, error);
  if (status != SUPINE_OK) {
    return status;
  }
  samples->name = strdup(path);
  if (samples->name == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
    goto cleanup;
  }
  for (bool more = true; more;) {
    status = supine_csv_next(&csv, &more, error);
    if (status == SUPINE_OK && more) {
      status = samples_add(&csv, names, samples, error);
    }
    if (status != SUPINE_OK) {
      goto cleanup;
    }
  }
cleanup:
  supine_csv_close(&csv);
  if (status != SUPINE_OK) {
    supine_breath_samples_clear(samples);
  }
  return status;
}

void supine_breath_samples_clear(supine_pv_samples *samples) {
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    free(samples->line[limb]);
    free(samples->volume[limb]);
    free(samples->pressure[limb]);
  }
  free(samples->name);
  *samples = (supine_pv_samples){0};
}

supine_status supine_breath_fit_samples(const supine_pv_samples *samples, double confidence,
                                        supine_pv *pv, supine_pv_report *reports,
                                        supine_error *error) {
  supine_pv found = {0};
  supine_pv_report told[SUPINE_PV_LIMB_COUNT] = {{0}};
  int fitted = 0;
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    if (samples->count[limb] == 0 && (fitted > 0 || limb + 1 < SUPINE_PV_LIMB_COUNT)) {
      continue;
    }
    const supine_status status = supine_breath_fit(
        samples->count[limb], samples->pressure[limb], samples->volume[limb], samples->line[limb],
        samples->name, confidence, &found.limb[limb], &told[limb], error);
    if (status != SUPINE_OK) {
      return status;
    }
    ++fitted;
  }
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    if (samples->count[limb] == 0) {
      found.limb[limb] = found.limb[SUPINE_PV_LIMB_COUNT - 1 - limb];
    }
  }
  *pv = found;
  if (reports != NULL) {
    memcpy(reports, told, sizeof told);
  }
  return SUPINE_OK;
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

/* One row; `seen` remembers which limbs were read. */
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
  if (!seen[SUPINE_PV_INHALE]) {
    found.limb[SUPINE_PV_INHALE] = found.limb[SUPINE_PV_EXHALE];
  } else if (!seen[SUPINE_PV_EXHALE]) {
    found.limb[SUPINE_PV_EXHALE] = found.limb[SUPINE_PV_INHALE];
  }
  *pv = found;
  return SUPINE_OK;
}
