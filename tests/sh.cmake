# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(base/base supine_base)
supine_test(base/number supine_base m)
supine_test(base/quantity supine_base m)
supine_test(base/csv supine_base)
supine_test(base/inputs supine_base)
target_compile_definitions(test_inputs PRIVATE SUPINE_INPUTS_PAGE="${PROJECT_SOURCE_DIR}/docs/inputs.md") # the table of checks
supine_test(sh/sh_basis supine_sh m)
supine_test(sh/sh_grid supine_sh m)
supine_test(sh/transform supine_sh m)
