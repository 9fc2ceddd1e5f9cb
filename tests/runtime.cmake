# SPDX-License-Identifier: GPL-3.0-or-later

# Make synthetic bases for tests, and evaluate them independently of the library.
add_library(runtime_fixture STATIC helpers/runtime_fixture.c)
target_link_libraries(runtime_fixture
  PRIVATE supine_build PkgConfig::CMOCKA
  PUBLIC supine_runtime)

supine_test(runtime/safetensors runtime_fixture)
supine_test(runtime/golden supine_runtime)
target_compile_definitions(test_golden PRIVATE SUPINE_GOLDEN="${CMAKE_CURRENT_SOURCE_DIR}/golden")
find_package(Python3 COMPONENTS Interpreter)
if(Python3_FOUND)
  set(bases basis_lungs basis_scalar basis_vector basis_clusters basis_simulated open_surface)
  list(TRANSFORM bases REPLACE "(.+)" "${CMAKE_CURRENT_SOURCE_DIR}/golden/\\1.safetensors")
  add_test(NAME checksum_python COMMAND ${Python3_EXECUTABLE}
    ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_checksum.py ${bases})
endif()
supine_test(runtime/posture runtime_fixture)
supine_test(runtime/state supine_runtime)
supine_test(runtime/volume runtime_fixture)
supine_test(runtime/kriging runtime_fixture)
supine_test(runtime/locate runtime_fixture)
supine_test(runtime/doubt runtime_fixture)
supine_test(runtime/runtime_basis runtime_fixture)
supine_test(runtime/deform runtime_fixture)
supine_test(runtime/deform_lit runtime_fixture)
supine_test(runtime/clusters runtime_fixture)
supine_test(runtime/simulated runtime_fixture)

# Make the synthetic bases among the golden files.
add_executable(make_golden helpers/make_golden.c)
target_link_libraries(make_golden PRIVATE supine_build runtime_fixture PkgConfig::CMOCKA)

# Use the installed library by CMake and by pkg-config.
add_executable(make_basis install/make_basis.c)
target_include_directories(make_basis PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(make_basis PRIVATE supine_build runtime_fixture PkgConfig::CMOCKA)
include(CheckLanguage)
check_language(CXX)
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE AND CMAKE_CXX_COMPILER)
  add_test(NAME install COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_install.sh ${CMAKE_COMMAND}
    ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR} $<TARGET_FILE:make_basis>
    ${CMAKE_C_COMPILER} ${CMAKE_CXX_COMPILER})
  set_tests_properties(install PROPERTIES TIMEOUT ${hang})
endif()

# Test the Python package with Debian's python.
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE)
  set(python /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_python.py
    ${PROJECT_SOURCE_DIR} $<TARGET_FILE:supine_runtime_shared> $<TARGET_FILE:supine_precompute_shared>
    $<TARGET_FILE:supine> ${CMAKE_C_COMPILER})
  add_test(NAME python COMMAND ${python} quick)
  add_test(NAME python_full COMMAND ${python})
  set_tests_properties(python python_full PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
endif()

# Give a right and a wrong input of each row of docs/inputs.md to every interface.
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE)
  add_test(NAME inputs_everywhere COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/inputs.py ${PROJECT_BINARY_DIR})
  # Give each input of each interface every kind of mistake.
  add_test(NAME doors COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/doors.py ${PROJECT_BINARY_DIR})
  # Run the module for 3D Slicer with stand-ins for Slicer's.
  add_test(NAME slicer COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_slicer.py ${PROJECT_BINARY_DIR})
  # Follow each advice of the program.
  add_test(NAME remedies COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/remedies.py ${PROJECT_BINARY_DIR})
  set_tests_properties(inputs_everywhere doors remedies PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77 FIXTURES_REQUIRED npm_package)
  set_tests_properties(slicer PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
endif()

# Build and run the library for other platforms, where their compilers and emulators are installed.
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE)
  foreach(platform gcc clang musl aarch64 windows)
    add_test(NAME platform_${platform} COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_platform.sh ${platform} ${CMAKE_COMMAND}
      ${PROJECT_SOURCE_DIR} $<TARGET_FILE:supine_runtime> ${CMAKE_C_COMPILER} $<TARGET_FILE:supine>)
    set_tests_properties(platform_${platform} PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
  endforeach()
endif()

supine_test(runtime/runtime_quiet runtime_fixture)
foreach(name malloc calloc realloc aligned_alloc strdup free mmap munmap open close)
  target_link_options(test_runtime_quiet PRIVATE -Wl,--wrap=${name})
endforeach()
supine_test(runtime/runtime_threads runtime_fixture Threads::Threads)
if(NOT SUPINE_SANITIZE) # sanitizers use more stack
  supine_test(runtime/runtime_stack runtime_fixture Threads::Threads)
endif()

# Test the GPU shader, if EGL can run it without a window, but not with the thread sanitizer, which does not know the
# threads of the driver.
pkg_check_modules(EGL IMPORTED_TARGET egl glesv2)
if(EGL_FOUND AND NOT SUPINE_SANITIZE MATCHES "thread")
  supine_test(runtime/glsl runtime_fixture PkgConfig::EGL)
  target_compile_definitions(test_glsl PRIVATE SUPINE_GLSL="${PROJECT_SOURCE_DIR}/runtime/supine.glsl")
  # Ignore memory leaks of the driver.
  set_tests_properties(glsl PROPERTIES ENVIRONMENT "ASAN_OPTIONS=detect_leaks=0;LIBGL_ALWAYS_SOFTWARE=1")
endif()

# Follow the recipes of CONTRIBUTING.md on a copy of the sources.
add_test(NAME recipes COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/recipes.py ${PROJECT_SOURCE_DIR})
set_tests_properties(recipes PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 1800)

# Check that the sources follow the table of folders in ARCHITECTURE.md.
if(Python3_FOUND)
  add_test(NAME house COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/house.py
    ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR})
  add_test(NAME workflows COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_workflows.py
    ${PROJECT_SOURCE_DIR})
  set_tests_properties(workflows PROPERTIES SKIP_RETURN_CODE 77)
  # Check that the numbers of docs/model.md are those of the code, and the promises those of the headers.
  add_test(NAME pages COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_pages.py ${PROJECT_SOURCE_DIR})
endif()

# Check that README.md shows the program that the test `install` builds.
add_test(NAME readme_example COMMAND sh -c
  "sed -n '/^```c$/,/^```$/p' README.md | sed '1d;$d' | cmp - examples/deform/deform.c"
  WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
