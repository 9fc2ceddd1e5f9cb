# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(program/template supine_export)

# The build fails if a template has a placeholder for which there is no value.
add_test(NAME template_unknown_name COMMAND ${CMAKE_COMMAND}
  -D FILES=${CMAKE_CURRENT_SOURCE_DIR}/golden/unknown_name.html
  -D SOURCES=${CMAKE_CURRENT_SOURCE_DIR}/program/test_template.c -D ARRAY=assets
  -D OUTPUT=${CMAKE_CURRENT_BINARY_DIR}/unknown_name.c
  -P ${PROJECT_SOURCE_DIR}/cmake/embed.cmake)
set_tests_properties(template_unknown_name PROPERTIES PASS_REGULAR_EXPRESSION
  "nothing fills {{untold}}")
