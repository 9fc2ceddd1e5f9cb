# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(program/export_glb runtime_fixture supine_commands PkgConfig::JANSSON supine_gsl)
supine_test(program/export_html runtime_fixture supine_commands supine_gsl ${MESHOPT_LINK_LIBRARIES})

# Open exported files in other programs, and compare them with the C evaluator. The tests need node, the packages in
# tests/export/package.json (npm install in that folder) and, for pages, Chromium; otherwise they are skipped.
add_executable(export_positions export/positions.c)
target_link_libraries(export_positions PRIVATE supine_build supine_runtime)
find_program(NODE_PROGRAM NAMES node nodejs)
find_program(CHROMIUM_PROGRAM NAMES chromium chromium-browser google-chrome)
set(SUPINE_NODE_MODULES ${CMAKE_CURRENT_SOURCE_DIR}/export CACHE PATH
  "Folder whose node_modules the tests of exported files use")
if(NODE_PROGRAM)
  set(SUPINE_NODE ${NODE_PROGRAM})
else()
  set(SUPINE_NODE sh -c "echo 'skipped: node is not installed'; exit 77")
endif()
foreach(what colour glb numbers pages) # pages.mjs holds all tests that need a browser
  add_test(NAME export_${what}_node COMMAND ${SUPINE_NODE} ${CMAKE_CURRENT_SOURCE_DIR}/export/${what}.mjs)
  set_tests_properties(export_${what}_node PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77 ENVIRONMENT
    "SUPINE=$<TARGET_FILE:supine>;POSITIONS=$<TARGET_FILE:export_positions>;MODULES=${SUPINE_NODE_MODULES};CHROMIUM=${CHROMIUM_PROGRAM}")
endforeach()
