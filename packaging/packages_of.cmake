# SPDX-License-Identifier: GPL-3.0-or-later
# supine_packages_of(RESULT FILES...): set RESULT to the sorted names of the Debian packages that hold these shared
# libraries, or the files that they link to. It is empty if dpkg is not installed.
#
# cmake -DFILES=FILE;FILE -P packages_of.cmake prints these names, separated by commas.
function(supine_packages_of result)
  find_program(SUPINE_DPKG_QUERY dpkg-query)
  set(packages)
  if(SUPINE_DPKG_QUERY)
    foreach(file ${ARGN})
      file(REAL_PATH ${file} file) # the link that the compiler uses belongs to the package for developers
      string(REGEX REPLACE "^/usr/" "/" old_place ${file}) # where the package has it if /lib is a link to /usr/lib
      set(found)
      foreach(place ${file} ${old_place})
        if(NOT found)
          execute_process(COMMAND ${SUPINE_DPKG_QUERY} --search ${place} OUTPUT_VARIABLE found ERROR_QUIET)
        endif()
      endforeach()
      if(found)
        string(REGEX REPLACE "[:,].*" "" package "${found}")
        list(APPEND packages ${package})
      else()
        message(STATUS "${file} belongs to no Debian package: a package that is built here does not depend on it")
      endif()
    endforeach()
    list(REMOVE_DUPLICATES packages)
    list(SORT packages)
  endif()
  set(${result} ${packages} PARENT_SCOPE)
endfunction()

if(CMAKE_SCRIPT_MODE_FILE)
  cmake_policy(SET CMP0007 NEW)
  supine_packages_of(packages ${FILES})
  list(JOIN packages ", " packages)
  message("${packages}")
endif()
