#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Build the run-time library for a platform, static and shared, without warnings. Run the same program with each, and
# compare positions and normals with those of the library of this system: the same bytes on x86-64, and within 5e-5 (mm;
# normals have length 1) elsewhere. The names in the shared library must be those in the headers.
#
#     test_platform.sh gcc|clang|musl|aarch64|windows CMAKE SOURCE_FOLDER LIBRARY CC PROGRAM
#
# aarch64 runs in qemu-user, Windows in wine. Exit with 77 if the compiler or the emulator is missing.
set -eu
platform=$1 cmake=$2 source=$3 library=$4 cc=$5 supine=$6
runner='' options='' shared=libsupine_runtime.so tool='' tolerance=0 exe='' libm=-lm
case $platform in
gcc | clang) compiler=$platform ;;
musl) compiler=musl-gcc ;;
aarch64)
  compiler=aarch64-linux-gnu-gcc runner='qemu-aarch64 -L /usr/aarch64-linux-gnu' tool=aarch64-linux-gnu- tolerance=5e-5
  options='-DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64'
  ;;
windows)
  compiler=x86_64-w64-mingw32-gcc runner=$(command -v wine64 || command -v wine || echo wine) exe=.exe libm=''
  shared=libsupine_runtime.dll
  ;;
*)
  echo "usage: test_platform.sh gcc|clang|musl|aarch64|windows CMAKE SOURCE_FOLDER LIBRARY CC PROGRAM"
  exit 1
  ;;
esac
for needed in "$compiler" ${runner%% *}; do
  command -v "$needed" >/dev/null || { echo "skipped: $needed is not installed"; exit 77; }
done
work=$(mktemp -d)
# Wine's server outlives the programs, and writes files when it ends.
trap '{ [ "$platform" != windows ] || { wineserver -k; wineserver -w; }; } >/dev/null 2>&1 || true; rm -rf "$work"' EXIT
export WINEPREFIX="$work/wine" WINEDEBUG=-all WINEDLLOVERRIDES=mscoree,mshtml=
if [ "$platform" = windows ]; then
  set -- "-DCMAKE_TOOLCHAIN_FILE=$source/cmake/windows.cmake"
else
  set -- "-DCMAKE_C_COMPILER=$compiler"
fi
# shellcheck disable=SC2086
"$cmake" -S "$source" -B "$work/build" -G Ninja "$@" $options -DSUPINE_RUNTIME_ONLY=ON -DSUPINE_WERROR=ON -DBUILD_TESTING=OFF \
  -DSUPINE_XXHASH_HEADER=/usr/include/xxhash.h >"$work/log"
"$cmake" --build "$work/build" >>"$work/log" || { cat "$work/log"; exit 1; }
built=$work/build/runtime

include="-I$source/runtime/include"
for header in "$source"/runtime/include/supine/*.h; do
  printf '#include "%s"\n' "$header"
done >"$work/all.c"
"$cc" -std=c17 -E -P "$include" "$work/all.c" | grep -o 'supine_[a-z0-9_]*(' | tr -d '(' | sort -u >"$work/declared"
if [ "$platform" = windows ]; then
  x86_64-w64-mingw32-objdump -p "$built/$shared" >"$work/dump"
  grep 'DLL Name' "$work/dump" | grep -viE 'KERNEL32|msvcrt' && { echo "the library needs more than system libraries"; exit 1; }
  sed -n 's/.*\[ *[0-9]*\] .*\(supine_[a-z0-9_]*\)$/\1/p' "$work/dump"
else
  "${tool}nm" --dynamic --defined-only "$built/$shared" | sed -n 's/.* T \(supine_[a-z0-9_]*\).*/\1/p'
fi | sort -u >"$work/shown"
diff "$work/declared" "$work/shown" || { echo "the headers (<) and the library (>) have different functions"; exit 1; }

program=$source/tests/python/reference.c
cd "$work"
"$supine" phantom --vertices 300 -o lungs.ply >>log 2>&1
"$supine" precompute lungs.ply --held-out 20 -o basis.safetensors >>log 2>&1
"$cc" -O2 "$include" "$program" "$library" -lm -o here
# shellcheck disable=SC2086
"$compiler" -O2 "$include" "$program" "$built/libsupine_runtime.a" $libm -o "static$exe"
if [ "$platform" = windows ]; then
  cp "$built/$shared" .
  "$compiler" -O2 "$include" "$program" "$built/$shared.a" -o "shared$exe"
else
  "$compiler" -O2 "$include" "$program" "$built/$shared" -Wl,-rpath,"$built" -o "shared$exe"
fi
run() {
  # shellcheck disable=SC2086
  timeout 400 $runner "$@"
}
for state in prone:full-1000 left:rest+200; do
  ./here basis.safetensors $state expected
  for kind in static shared; do
    rm -f found
    run "./$kind$exe" basis.safetensors $state found 2>log || { cat log; exit 1; }
    if [ "$tolerance" = 0 ]; then
      cmp expected found
    else
      python3 - expected found "$tolerance" <<'PYTHON'
import array, sys
a, b = (array.array("f", open(name, "rb").read()) for name in sys.argv[1:3])
off = max(abs(x - y) for x, y in zip(a, b, strict=True))
print(f"{len(a)} numbers differ by at most {off:.2g}")
sys.exit(off > float(sys.argv[3]))
PYTHON
    fi
  done
done
head -c 10000 basis.safetensors >"cut"
run "./static$exe" cut prone 2>log && exit 1
grep -q '^cut: truncated' log || { cat log; exit 1; }
run "./static$exe" nowhere prone 2>log && exit 1
grep -q '^nowhere: cannot read' log || { cat log; exit 1; }
echo "$platform: static and shared library built and run"
