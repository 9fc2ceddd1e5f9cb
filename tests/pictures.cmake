# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(runtime/compare runtime_fixture)
supine_test(program/render supine_render runtime_fixture m)
supine_test(program/pictures_command supine_base PkgConfig::JANSSON m)
target_compile_definitions(test_pictures_command PRIVATE SUPINE_PROGRAM="$<TARGET_FILE:supine>"
  SUPINE_GOLDEN="${CMAKE_CURRENT_SOURCE_DIR}/golden")
pkg_check_modules(WEBPDEMUX REQUIRED IMPORTED_TARGET libwebpdemux)
target_link_libraries(test_pictures_command PRIVATE PkgConfig::CAIRO PkgConfig::WEBPDEMUX)
# In builds with a sanitizer, ignore memory that fontconfig keeps.
set_tests_properties(pictures_command PROPERTIES
  ENVIRONMENT "LSAN_OPTIONS=suppressions=${CMAKE_CURRENT_SOURCE_DIR}/lsan.supp:print_suppressions=0")
