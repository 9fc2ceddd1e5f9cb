# SPDX-License-Identifier: GPL-3.0-or-later
# Embed files as an array in C: cmake -D OUTPUT=assets.c -D ARRAY=name -D FILES=a;b -D SOURCES=c;d -P embed.cmake
# Each becomes an entry {name, bytes, size} of ARRAY, in the order given. Every {{name}} in an .html file must be
# the name of another file, or occur as "name" in one of SOURCES.
set(known "")
foreach(path IN LISTS FILES)
  get_filename_component(name "${path}" NAME)
  string(APPEND known "\"${name}\" ")
endforeach()
foreach(path IN LISTS SOURCES)
  file(READ "${path}" text)
  string(APPEND known "${text}")
endforeach()
set(arrays "")
set(table "")
set(number 0)
foreach(path IN LISTS FILES)
  get_filename_component(name "${path}" NAME)
  if(name MATCHES "\\.html$")
    file(READ "${path}" text)
    string(REGEX MATCHALL "{{[^}]*}}" tags "${text}")
    foreach(tag IN LISTS tags)
      string(REGEX REPLACE "^{{[#/]?(.*)}}$" "\\1" tag "${tag}")
      string(FIND "${known}" "\"${tag}\"" found)
      if(found EQUAL -1 AND NOT tag STREQUAL ".")
        message(FATAL_ERROR "nothing fills {{${tag}}} in ${path}") # CMake wraps long messages
      endif()
    endforeach()
  endif()
  file(READ "${path}" hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(REGEX REPLACE "(0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,)"
    "\\1\n" bytes "${bytes}")
  string(APPEND arrays "static const unsigned char asset_${number}[] = {\n${bytes}0};\n")
  string(APPEND table
    "    {\"${name}\", (const char *)asset_${number}, sizeof asset_${number} - 1},\n")
  math(EXPR number "${number} + 1")
endforeach()
file(WRITE "${OUTPUT}" "/* Made by embed.cmake. */
#include \"program/export/template.h\"

${arrays}
extern const supine_asset ${ARRAY}[];
const supine_asset ${ARRAY}[] = {
${table}    {0}};
")
