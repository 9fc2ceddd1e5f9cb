/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read samples of a pressure-volume relation (CSV), and its parameters (JSON). */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "base/arena.h"
#include "base/csv.h"
#include "base/locale.h"
#include "base/number.h"
#include "base/text.h"

#include "program/options/pv.h"

/* Read the limb of a row; if the file has no column "limb", the limb is inhale. */
static supine_status read_limb(const supine_csv *csv, supine_pv_limb *limb, supine_error *error) {
  const char *text = supine_csv_text(csv, 2);
  for (int i = 0; i < SUPINE_PV_LIMB_COUNT; ++i) {
    *limb = (supine_pv_limb)i;
    if (text == NULL || strcmp(text, supine_breath_limb_name(*limb)) == 0) {
      return SUPINE_OK;
    }
  }
  return supine_error_set(error, SUPINE_ERROR_FORMAT,
                          "%s:%zu: limb \"%s\" is unknown: give inhale or exhale", csv->path,
                          csv->line, text);
}

typedef struct samples {
  size_t count;
  supine_pv_sample *sample;
} samples;

static supine_status add_sample(const supine_csv *csv, const char *const *names, samples *limbs,
                                supine_error *error) {
  supine_pv_limb limb = SUPINE_PV_INHALE;
  supine_pv_sample sample = {.line = csv->line};
  SUPINE_TRY(read_limb(csv, &limb, error));
  SUPINE_TRY(supine_csv_number(csv, 0, names[0], &sample.pressure, error));
  SUPINE_TRY(supine_csv_number(csv, 1, names[1], &sample.volume, error));
  samples *into = &limbs[limb];
  supine_pv_sample *grown = realloc(into->sample, (into->count + 1) * sizeof *grown);
  if (grown == NULL) {
    return supine_error_memory(error, "%zu samples", into->count + 1);
  }
  into->sample = grown;
  into->sample[into->count++] = sample;
  return SUPINE_OK;
}

static supine_status load_samples(const char *path, samples *limbs, supine_error *error) {
  static const char *const names[] = {"pressure_cmH2O", "volume_mL", "limb"};
  SUPINE_FREED_BY(supine_csv_close) supine_csv csv = {0};
  SUPINE_TRY(supine_csv_open(path, names, 3, 2, &csv, error));
  for (bool more = true; more;) {
    SUPINE_TRY(supine_csv_next(&csv, &more, error));
    if (more) {
      SUPINE_TRY(add_sample(&csv, names, limbs, error));
    }
  }
  return SUPINE_OK;
}

static void free_samples(samples (*limbs)[SUPINE_PV_LIMB_COUNT]) {
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    free((*limbs)[limb].sample);
  }
}

supine_status supine_options_pv_fit_file(const char *path, double confidence, supine_pv *pv,
                                         supine_pv_report *reports, supine_error *error) {
  SUPINE_FREED_BY(free_samples) samples limbs[SUPINE_PV_LIMB_COUNT] = {{0}};
  SUPINE_TRY(load_samples(path, limbs, error));
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    const samples *of = &limbs[limb];
    reports[limb] = (supine_pv_report){0};
    if (of->count > 0 || limbs[1 - limb].count == 0) {
      SUPINE_TRY(supine_options_pv_fit(path, of->count, of->sample, confidence, &pv->limb[limb],
                                       &reports[limb], error));
    }
  }
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    if (limbs[limb].count == 0) {
      pv->limb[limb] = pv->limb[1 - limb];
    }
  }
  return SUPINE_OK;
}

static supine_status read_curve(json_t *limb, supine_pv_curve *curve, supine_error *error) {
  json_error_t why;
  double *p = curve->pressure;
  double *v = curve->volume;
  double *c = curve->control;
  const int unpacked = json_unpack_ex(limb, &why, 0, "{s:[F, F!], s:[F, F!], s:[F, F, F, F, F!]}",
                                      "pressure_cmH2O", &p[0], &p[1], "volume_mL", &v[0], &v[1],
                                      "control", &c[0], &c[1], &c[2], &c[3], &c[4]);
  SUPINE_REFUSE_IF(unpacked != 0, error, SUPINE_ERROR_FORMAT, "%s", why.text);
  return supine_breath_curve_check(curve, error);
}

supine_status supine_options_pv_load(const char *path, supine_pv *pv, supine_error *error) {
  SUPINE_C_LOCALE;
  json_error_t why;
  supine_pv found = {0};
  json_t *limbs[SUPINE_PV_LIMB_COUNT];
  SUPINE_FREED_BY(supine_file_close) FILE *file = fopen(path, "rb");
  json_auto_t *root = file == NULL ? NULL : json_loadf(file, JSON_REJECT_DUPLICATES, &why);
  SUPINE_REFUSE_IF(file == NULL || ferror(file) != 0, error, SUPINE_ERROR_READ,
                   "%s: cannot read: %s", path, strerror(errno));
  SUPINE_REFUSE_IF(root == NULL, error, SUPINE_ERROR_FORMAT,
                   "%s:%d: %s: make the file with 'supine pv fit'", path, why.line, why.text);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    const char *name = supine_breath_limb_name((supine_pv_limb)limb);
    supine_error wrong;
    limbs[limb] = json_object_get(root, name);
    if (limbs[limb] != NULL) {
      const supine_status status = read_curve(limbs[limb], &found.limb[limb], &wrong);
      if (status != SUPINE_OK) {
        supine_text_add(wrong.message, sizeof wrong.message,
                        ": make the file with 'supine pv fit'");
        wrong.status = SUPINE_ERROR_FORMAT;
        return supine_error_wrap(error, &wrong, "%s: %s: ", path, name);
      }
    }
  }
  SUPINE_REFUSE_IF(
      limbs[0] == NULL && limbs[1] == NULL, error, SUPINE_ERROR_FORMAT,
      "%s: neither the limb inhale nor exhale is given: make the file with 'supine pv fit'", path);
  for (int limb = 0; limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    pv->limb[limb] = found.limb[limbs[limb] != NULL ? limb : 1 - limb];
  }
  return SUPINE_OK;
}
