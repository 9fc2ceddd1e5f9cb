# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(compare runtime_fixture)
supine_test(render supine_render runtime_fixture m)
supine_test(see supine_base PkgConfig::JANSSON m)
target_compile_definitions(test_see PRIVATE SUPINE_PROGRAM="$<TARGET_FILE:supine>"
  SUPINE_GOLDEN="${CMAKE_CURRENT_SOURCE_DIR}/golden")
if(TARGET PkgConfig::RENDER)
  target_link_libraries(test_see PRIVATE PkgConfig::RENDER)
  target_compile_definitions(test_see PRIVATE SUPINE_TEST_CAIRO)
endif()
# Sanitizer builds: what fontconfig keeps is no leak of ours.
set_tests_properties(see PROPERTIES
  ENVIRONMENT "LSAN_OPTIONS=suppressions=${CMAKE_CURRENT_SOURCE_DIR}/lsan.supp:print_suppressions=0")
