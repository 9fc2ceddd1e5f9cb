#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Check that programs linked with an older run-time library still run: tests/abi.sh [REVISION]
#
# Compare the library of REVISION with that of HEAD by abidiff (Debian's abigail-tools). The default is the
# last tag or, if there is none, the commit that set the current version number. If the interfaces are equal,
# exit with 0. Otherwise print abidiff's report and exit with its code.
set -eu
source=$(cd "$(dirname "$0")/.." && pwd)
revision=${1:-$(git -C "$source" describe --tags --abbrev=0 2>/dev/null ||
  git -C "$source" log -1 --format=%h -G'define SUPINE_VERSION "' -- runtime/include/supine/version.h)}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# build REVISION NAME: build the library of REVISION in the folder $work/NAME.
build() {
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
