# SPDX-License-Identifier: GPL-3.0-or-later
# Files as an array in C: cmake -D OUTPUT=assets.c -D FILES=a;b -P embed.cmake
# Each becomes an entry {name, bytes, size} of supine_export_assets, in the order given.
set(arrays "")
set(table "")
set(number 0)
foreach(path IN LISTS FILES)
  get_filename_component(name "${path}" NAME)
  file(READ "${path}" hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(REGEX REPLACE "(0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,)"
    "\\1\n" bytes "${bytes}")
  string(APPEND arrays "static const unsigned char asset_${number}[] = {\n${bytes}};\n")
  string(APPEND table "    {\"${name}\", asset_${number}, sizeof asset_${number}},\n")
  math(EXPR number "${number} + 1")
endforeach()
file(WRITE "${OUTPUT}" "/* Made by embed.cmake. */
#include \"assets.h\"

${arrays}
const export_asset supine_export_assets[] = {
${table}};
const size_t supine_export_asset_count = ${number};
")
