/* SPDX-License-Identifier: GPL-3.0-or-later */
/* If any allocation fails while the applied force is computed from two surfaces, the function says
 * that memory ran out. The linker option --wrap redirects allocations to this file. */
#include <errno.h>

#include "precompute/patient/matching.h"
#include "tests/helpers/test.h"

#include "tests/helpers/lungs_helpers.h"

/* number of allocations that still succeed before one fails; negative if none shall fail */
static int allocations_left = -1;
static int allocations_failed;

static int allocation_fails(void) {
  const int fails = allocations_left >= 0 && allocations_left-- == 0;
  if (fails) {
    ++allocations_failed;
    errno = ENOMEM;
  }
  return fails;
}

/* NOLINTBEGIN(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp): names for ld --wrap */
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);

void *__wrap_malloc(size_t size) {
  return allocation_fails() ? NULL : __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size) {
  return allocation_fails() ? NULL : __real_calloc(count, size);
}
/* NOLINTEND(bugprone-reserved-identifier,cert-dcl37-c,cert-dcl51-cpp) */

TEST(test_applied_find_each_allocation_failing_reports_memory_error) {
  static const double supine[3] = {0.0, 1.0, 0.0};
  static const double path[3] = {1.0, 1.0, 1.0};
  supine_mesh lump = helper_lump(8, 60.0, 77);
  supine_mesh emptier = helper_lump(8, 60.0, 77);
  supine_lungs fuller = {0};
  supine_patient_matching matching = {0};
  supine_patient_applied applied = {0};
  assert_int_equal(supine_lungs_create(&lump, 1, NULL, &fuller, NULL), SUPINE_OK);
  for (size_t i = 0; i < emptier.vertex_count; ++i) {
    emptier.vertices[3 * i + 1] -= 0.05 * (emptier.vertices[3 * i + 1] - fuller.minimum[1]);
  }
  assert_int_equal(supine_patient_matching_create(&fuller, &emptier, 100, 0, &matching, NULL),
                   SUPINE_OK);
  const supine_patient patient = {.frame = matching.frame,
                                  .power = supine_patient_deep(supine, path)};
  int nth = 0;
  for (;; ++nth) {
    supine_error error = {0};
    allocations_left = nth;
    allocations_failed = 0;
    const supine_status status =
        supine_patient_applied_find(&matching, &patient, supine, &applied, &error);
    allocations_left = -1;
    if (allocations_failed == 0) {
      assert_int_equal(status, SUPINE_OK);
      break;
    }
    if (status != SUPINE_OK && status != SUPINE_ERROR_MEMORY) {
      fail_msg("allocation %d: status %d, \"%s\"", nth, (int)status, error.message);
    }
  }
  assert_true(nth >= 3); /* two work spaces and the list of cubes */
  assert_true(applied.blocks > 4);
  supine_patient_matching_free(&matching);
  supine_lungs_free(&fuller);
  supine_mesh_free(&lump);
  supine_mesh_free(&emptier);
}
