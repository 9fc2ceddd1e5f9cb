#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# What programs that were linked with an older run-time library would miss: tests/abi.sh [REVISION]
#
# Compares the library of REVISION with the one that is here, by abidiff (Debian's abigail-tools). By
# default that is the last tag's; while there is none, that of the commit which gave this version its number. Ends with 0 where nothing changed, and with abidiff's code and report else.
set -eu
source=$(cd "$(dirname "$0")/.." && pwd)
revision=${1:-$(git -C "$source" describe --tags --abbrev=0 2>/dev/null ||
  git -C "$source" log -1 --format=%h -G'define SUPINE_VERSION "' -- runtime/include/supine/version.h)}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
build() { # build REVISION: its library and headers in $work/REVISION's place
  mkdir "$work/$2"
  git -C "$source" archive "$1" | tar -x -C "$work/$2"
  (cd "$work/$2" && cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DBUILD_TESTING=OFF \
    -DCMAKE_INSTALL_PREFIX="$work/$2/installed" && cmake --build build --target supine_runtime_shared) >"$work/log" 2>&1 ||
    { tail -20 "$work/log"; exit 1; }
}
build "$revision" old
build HEAD new
exec abidiff --headers-dir1 "$work/old/runtime/include" --headers-dir2 "$work/new/runtime/include" \
  "$work"/old/build/runtime/libsupine_runtime.so "$work"/new/build/runtime/libsupine_runtime.so
