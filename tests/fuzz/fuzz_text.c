/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fuzz three readers of text files: expandability of vertices, samples of pressure and volume, and
 * fitted pressure-volume curves. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "precompute/lungs/expandability.h"
#include "program/options/pv.h"

#include "fuzz.h"

enum { VERTICES = 3 };

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
  const char *path = supine_fuzz_file(bytes, size, ".csv");
  supine_error error = {0};
  double a[VERTICES];
  supine_status status = supine_lungs_expandability_load(path, VERTICES, a, &error);
  supine_fuzz_expect_words(status, &error);
  for (size_t i = 0; status == SUPINE_OK && i < VERTICES; ++i) {
    supine_fuzz_expect(a[i] > 0.0 && isfinite(a[i]), "a positive finite expandability");
  }
  supine_pv pv;
  supine_pv_report reports[SUPINE_PV_LIMB_COUNT];
  status = supine_options_pv_fit_file(path, 0.95, &pv, reports, &error);
  supine_fuzz_expect_words(status, &error);
  status = supine_options_pv_load(path, &pv, &error);
  supine_fuzz_expect_words(status, &error);
  for (int limb = 0; status == SUPINE_OK && limb < SUPINE_PV_LIMB_COUNT; ++limb) {
    supine_fuzz_expect(supine_breath_curve_check(&pv.limb[limb], NULL) == SUPINE_OK,
                       "valid curves for inhaling and exhaling");
  }
  (void)unlink(path);
  return 0;
}

uint8_t *supine_fuzz_seed(size_t index, size_t *size) {
  static const char *const texts[] = {
      "expandability\n1\n0.5\n# half\n2e-1\n", "vertex,expandability\n0,1\n2,0.25\n1,3\n",
      ("pressure_cmH2O,volume_mL,limb\n0,100,inhale\n5,420,inhale\n10,900,inhale\n20,1500,inhale\n"
       "20,1500,exhale\n10,1200,exhale\n5,700,exhale\n0,150,exhale\n"),
      ("{\"inhale\": {\"pressure_cmH2O\": [0, 30], \"volume_mL\": [0, 6000],\n"
       "\"control\": [-0.7, -2.2, 0.5, 0.3, -0.1]}}")};
  enum { TEXTS = sizeof texts / sizeof *texts };
  return index < TEXTS ? supine_fuzz_text(texts[index], size) : NULL;
}
