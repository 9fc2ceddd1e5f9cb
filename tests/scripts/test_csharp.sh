#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Compile the C# example, deform a basis with it, and compare the positions with those of the C library:
#
#     test_csharp.sh SOURCE_FOLDER LIBRARY SUPINE CC MCS MONO
set -eu
source=$1 library=$2 supine=$3 cc=$4 mcs=$5 mono=$6
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
"$supine" phantom -o "$work/lungs.ply" --vertices 700 >"$work/log"
"$supine" precompute "$work/lungs.ply" -o "$work/lungs.safetensors" >>"$work/log"
"$cc" -I"$source/runtime/include" "$source/tests/python/reference.c" "$library" -o "$work/reference"
export LD_LIBRARY_PATH="${library%/*}"
"$work/reference" "$work/lungs.safetensors" prone:rest+500 "$work/expected"
# The file of expected results has 60 bytes for each vertex. It begins with the positions of all vertices.
vertices=$(($(wc -c <"$work/expected") / 60))
"$mcs" -warnaserror -out:"$work/Deform.exe" "$source/examples/csharp/Deform.cs"
"$mono" "$work/Deform.exe" "$work/lungs.safetensors" prone:rest+500 "$work/found"
cmp -n "$((12 * vertices))" "$work/expected" "$work/found"
[ "$(wc -c <"$work/found")" -eq "$((12 * vertices))" ]
# Errors have the library's message.
for words in "absent.safetensors prone absent.safetensors" "$work/lungs.safetensors pron 'prone'?"; do
  # shellcheck disable=SC2086
  set -- $words
  if "$mono" "$work/Deform.exe" "$1" "$2" "$work/none" 2>"$work/error"; then exit 1; fi
  grep -qF "$3" "$work/error"
done
[ ! -e "$work/none" ]
