# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(inside supine_inside supine_phantom)
supine_test(image supine_image)
supine_test(field supine_inside supine_field supine_phantom)
set_tests_properties(image PROPERTIES
  ENVIRONMENT "LSAN_OPTIONS=suppressions=${CMAKE_CURRENT_SOURCE_DIR}/lsan.supp:print_suppressions=0")
