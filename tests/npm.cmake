# SPDX-License-Identifier: GPL-3.0-or-later
# Compare the JavaScript package with the C library, in node and in Chromium.
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE)
  set(tarball ${PROJECT_BINARY_DIR}/runtime/js/supine-${PROJECT_VERSION}.tgz)
  add_executable(npm_native npm/native.c)
  target_link_libraries(npm_native PRIVATE supine_build supine_runtime)
  add_test(NAME npm_package COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/npm/package.sh ${tarball})
  set_tests_properties(npm_package PROPERTIES FIXTURES_SETUP npm_package)
  add_test(NAME wasm COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/npm/wasm.sh ${CMAKE_COMMAND} ${PROJECT_SOURCE_DIR})
  set_tests_properties(wasm PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
  foreach(where node browser)
    add_test(NAME npm_${where} COMMAND ${SUPINE_NODE} ${CMAKE_CURRENT_SOURCE_DIR}/npm/${where}.mjs)
    set_tests_properties(npm_${where} PROPERTIES FIXTURES_REQUIRED npm_package TIMEOUT ${hang} SKIP_RETURN_CODE 77 ENVIRONMENT
      "SUPINE=$<TARGET_FILE:supine>;NATIVE=$<TARGET_FILE:npm_native>;TARBALL=${tarball};GOLDEN=${CMAKE_CURRENT_SOURCE_DIR}/golden/basis_lungs.safetensors;LUNGS=${PROJECT_SOURCE_DIR}/examples/lungs;README=${PROJECT_SOURCE_DIR}/README.md;MODULES=${SUPINE_NODE_MODULES};CHROMIUM=${CHROMIUM_PROGRAM}")
  endforeach()
  add_test(NAME fuzz_npm_node COMMAND ${SUPINE_NODE} ${CMAKE_CURRENT_SOURCE_DIR}/fuzz/numbers.mjs
    ${PROJECT_BINARY_DIR}/runtime/js/package/supine.js)
  set_tests_properties(fuzz_npm_node PROPERTIES FIXTURES_REQUIRED npm_package TIMEOUT ${hang} SKIP_RETURN_CODE 77 ENVIRONMENT
    "SUPINE=$<TARGET_FILE:supine>")
endif()
