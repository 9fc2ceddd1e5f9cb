# SPDX-License-Identifier: GPL-3.0-or-later
# supine_stream_test(NAME LIBRARIES...): the cmocka program stream/test_stream_NAME.c.
function(supine_stream_test name)
  add_executable(test_stream_${name} stream/test_stream_${name}.c)
  target_link_libraries(test_stream_${name} PRIVATE supine_build runtime_fixture supine_stream
    ${ARGN} supine_gsl PkgConfig::CMOCKA)
  add_test(NAME stream_${name} COMMAND test_stream_${name})
  set_tests_properties(stream_${name} PROPERTIES TIMEOUT 300
    ENVIRONMENT "TSAN_OPTIONS=suppressions=${CMAKE_CURRENT_SOURCE_DIR}/tsan.supp")
endfunction()

supine_stream_test(gravity)
supine_stream_test(poses)
supine_stream_test(server supine_base Threads::Threads)

# The protocol's public library is what bytes and behaviour are held against.
find_library(IGTL_LIBRARY OpenIGTLink)
find_path(IGTL_INCLUDE igtlMessageBase.h PATH_SUFFIXES openigtlink)
if(IGTL_LIBRARY AND IGTL_INCLUDE)
  add_library(igtl INTERFACE)
  target_include_directories(igtl SYSTEM INTERFACE ${IGTL_INCLUDE})
  target_link_libraries(igtl INTERFACE ${IGTL_LIBRARY})
  supine_stream_test(wire igtl)
else()
  message(STATUS "No libopenigtlink: 'supine stream' is not tested against it")
endif()
