# SPDX-License-Identifier: GPL-3.0-or-later
# supine_stream_test(NAME LIBRARIES...): add the cmocka program stream/test_stream_NAME.c as a test.
function(supine_stream_test name)
  supine_test(stream/stream_${name} runtime_fixture supine_stream ${ARGN} supine_gsl)
endfunction()

supine_stream_test(gravity)
supine_stream_test(volume)
supine_stream_test(server supine_base Threads::Threads)

# Run clients with a real server.
find_package(Python3 COMPONENTS Interpreter)
set(examples ${PROJECT_SOURCE_DIR}/examples)
set(with_server ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/stream/with_server.py
  $<TARGET_FILE:supine>)
if(Python3_EXECUTABLE)
  add_test(NAME stream_link COMMAND ${with_server} 1000 "--volume rest+400 --device Patient"
    ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/stream/stream_link.py ${examples}/tracker {port} {basis})
  add_test(NAME stream_turn COMMAND ${with_server} 500 "--volume rest+400"
    ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/stream/stream_turn.py ${examples}/tracker/turn.py {port} {basis})
  add_test(NAME stream_slicer COMMAND ${with_server} 500
      "--volume rest+400 --space ras --world-down 0,-1,0 --body-from-tracker 0,0,0,1"
    ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/stream/stream_slicer.py ${examples}
    {port} {basis})
  add_test(NAME stream_points COMMAND ${Python3_EXECUTABLE}
    ${CMAKE_CURRENT_SOURCE_DIR}/stream/stream_points.py $<TARGET_FILE:supine> ${examples}/tracker)
  set_tests_properties(stream_points PROPERTIES TIMEOUT ${hang})
  add_test(NAME stream_web COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/stream/stream_web.py
    $<TARGET_FILE:supine>)
  set_tests_properties(stream_web PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
  # Test the Unity example, compiled by Mono with stubs for the types of the engine.
  find_program(MCS_PROGRAM mcs)
  find_program(MONO_PROGRAM mono)
  if(MCS_PROGRAM AND MONO_PROGRAM AND NOT SUPINE_SANITIZE)
    set(unity ${CMAKE_CURRENT_BINARY_DIR}/unity)
    file(MAKE_DIRECTORY ${unity})
    add_test(NAME stream_unity_link_compiles COMMAND ${MCS_PROGRAM} -warnaserror
      -out:${unity}/link.exe ${examples}/unity/SupineLink.cs ${examples}/unity/LungBehaviour.cs
      ${CMAKE_CURRENT_SOURCE_DIR}/stream/UnityStub.cs ${CMAKE_CURRENT_SOURCE_DIR}/stream/TestLink.cs)
    add_test(NAME stream_unity COMMAND ${with_server} 1000 "--volume rest+400"
      ${CMAKE_COMMAND} -E env LD_LIBRARY_PATH=$<TARGET_FILE_DIR:supine_runtime_shared>
      ${MONO_PROGRAM} ${unity}/link.exe {port} {basis})
    set_tests_properties(stream_unity_link_compiles PROPERTIES FIXTURES_SETUP unity)
    set_tests_properties(stream_unity PROPERTIES FIXTURES_REQUIRED unity TIMEOUT ${hang})
    add_test(NAME csharp COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_csharp.sh ${PROJECT_SOURCE_DIR}
      $<TARGET_FILE:supine_runtime_shared> $<TARGET_FILE:supine> ${CMAKE_C_COMPILER} ${MCS_PROGRAM} ${MONO_PROGRAM})
  endif()
  # Test the live page in headless Chromium.
  if(NODE_PROGRAM)
    add_test(NAME stream_page COMMAND ${with_server} 1000 "--volume rest+300 --web 0"
      ${NODE_PROGRAM} ${CMAKE_CURRENT_SOURCE_DIR}/stream/stream_page.mjs {page} {port})
    set_tests_properties(stream_page PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77 ENVIRONMENT
      "MODULES=${SUPINE_NODE_MODULES};CHROMIUM=${CHROMIUM_PROGRAM}")
  endif()
endif()

# Compare messages with those of the public OpenIGTLink library.
find_library(IGTL_LIBRARY OpenIGTLink)
find_path(IGTL_INCLUDE igtlMessageBase.h PATH_SUFFIXES openigtlink)
if(IGTL_LIBRARY AND IGTL_INCLUDE)
  add_library(igtl INTERFACE)
  target_include_directories(igtl SYSTEM INTERFACE ${IGTL_INCLUDE})
  target_link_libraries(igtl INTERFACE ${IGTL_LIBRARY})
  supine_stream_test(wire igtl)
  include(CheckLanguage)
  check_language(CXX)
  if(CMAKE_CXX_COMPILER AND Python3_EXECUTABLE)
    enable_language(CXX)
    add_executable(stream_peer stream/stream_peer.cpp)
    target_link_libraries(stream_peer PRIVATE supine_runtime igtl Threads::Threads)
    add_test(NAME stream_igtl COMMAND ${with_server} 2000 "--volume rest+400 --device Patient"
      $<TARGET_FILE:stream_peer> {port} {basis})
  endif()
else()
  message(STATUS "No libopenigtlink: 'supine stream' is not tested against it")
endif()
