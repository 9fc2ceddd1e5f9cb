#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Build the run-time library for Windows by Debian's gcc-mingw-w64-x86-64-win32, without warnings. Check that it
# exports what the headers declare and needs only system libraries, and that its results under wine (wine64) have
# the same bits as those of this system.
#
#     test_windows.sh CMAKE SOURCE_FOLDER LIBRARY CC
set -eu
cmake=$1 source=$2 library=$3 cc=$4
command -v x86_64-w64-mingw32-gcc >/dev/null || { echo "skipped: no x86_64-w64-mingw32-gcc"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$cmake" -S "$source" -B "$work/build" -G Ninja --toolchain "$source/cmake/windows.cmake" -DSUPINE_RUNTIME_ONLY=ON \
  -DSUPINE_WERROR=ON >"$work/log"
"$cmake" --build "$work/build" >>"$work/log" || { cat "$work/log"; exit 1; }
dll=$work/build/runtime/libsupine_runtime.dll

x86_64-w64-mingw32-objdump -p "$dll" >"$work/dump"
grep 'DLL Name' "$work/dump" | grep -viE 'KERNEL32|msvcrt' && { echo "the library needs more than system libraries"; exit 1; }
sed -n 's/.*\[ *[0-9]*\] .*\(supine_[a-z0-9_]*\)$/\1/p' "$work/dump" | sort -u >"$work/shown"
nm -g --defined-only "$library" | awk 'NF == 3 {print $3}' | sort -u >"$work/here"
[ "$(grep -cx 'supine_deform' "$work/shown")" = 1 ]
[ -z "$(comm -23 "$work/shown" "$work/here")" ] || { echo "the library exports names that the other build does not define"; exit 1; }
for header in "$source"/runtime/include/supine/*.h; do
  printf '#include "%s"\n' "$header"
done >"$work/all.c"
include="-I$source/runtime/include"
# shellcheck disable=SC2086
"$cc" -std=c17 -E -P $include "$work/all.c" | grep -o 'supine_[a-z0-9_]*(' | tr -d '(' | sort -u >"$work/declared"
diff "$work/declared" "$work/shown" || { echo "the headers (<) and the library (>) have different functions"; exit 1; }

wine=$(command -v wine64 || ls /usr/lib/wine/wine64 2>/dev/null) || { echo "built; not run: no wine64"; exit 0; }
# shellcheck disable=SC2086
x86_64-w64-mingw32-gcc -O2 $include "$source/tests/python/reference.c" "$dll.a" -o "$work/reference.exe"
# shellcheck disable=SC2086
"$cc" -O2 $include "$source/tests/python/reference.c" "$library" -lm -o "$work/reference"
cp "$dll" "$source/tests/golden/basis_2.safetensors" "$work"
cd "$work"
export WINEPREFIX="$work/wine" WINEDEBUG=-all
# Wine's server outlives the programs, and writes files when it ends.
trap '{ wineserver -k; wineserver -w; } >/dev/null 2>&1 || true; rm -rf "$work"' EXIT
run() {
  timeout 400 "$wine" "$@"
}
printf '#include <stdio.h>\nint main(void) { return puts("here") < 0; }\n' >hello.c
x86_64-w64-mingw32-gcc hello.c -o hello.exe
[ "$(run ./hello.exe 2>>log | tr -d '\r')" = here ] || { echo "built; not run: wine does not start"; exit 0; }
run ./reference.exe basis_2.safetensors prone 0.5 there 2>>log || { cat log; exit 1; }
./reference basis_2.safetensors prone 0.5 here_
cmp there here_
head -c 20000 basis_2.safetensors >"cut"
run ./reference.exe cut prone 0.5 2>log && exit 1
grep -q '^cut: truncated' log || { cat log; exit 1; }
run ./reference.exe nowhere prone 0.5 2>log && exit 1
grep -q '^nowhere: cannot read' log || { cat log; exit 1; }
echo "built, and run under wine: same bits as on this system"
