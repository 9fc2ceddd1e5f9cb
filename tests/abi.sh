#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Check that programs linked with an older run-time library still run: tests/abi.sh [REVISION]
#
# Compare the library of REVISION with that of HEAD by abidiff (Debian's abigail-tools). The default is the last tag of the
# same minor version; before its first release, the interface may change, and there is nothing to compare. If the
# interfaces are equal, exit with 0; if abidiff or the tag is missing, with 77 (skipped); otherwise print abidiff's report
# and exit with its code.
set -eu
source=$(cd "$(dirname "$0")/.." && pwd)
minor=$(sed -n 's/^#define SUPINE_VERSION "\(.*\)\..*"/\1/p' "$source/runtime/include/supine/version.h")
command -v abidiff >/dev/null || { echo "skipped: abidiff is not installed"; exit 77; }
revision=${1:-$(git -C "$source" describe --tags --abbrev=0 --match "v$minor.*" 2>/dev/null)} ||
  { echo "skipped: no tag v$minor.* in a git repository, so the interface may still change"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# build REVISION NAME: build the library of REVISION in the folder $work/NAME.
build() {
  mkdir "$work/$2"
  git -C "$source" archive "$1" | tar -x -C "$work/$2"
  (cd "$work/$2" && cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DSUPINE_RUNTIME_ONLY=ON -DBUILD_TESTING=OFF &&
    cmake --build build --target supine_runtime_shared) >"$work/log" 2>&1 ||
    { tail -20 "$work/log"; exit 1; }
}
build "$revision" old
build HEAD new
abidiff --headers-dir1 "$work/old/runtime/include" --headers-dir2 "$work/new/runtime/include" \
  "$work"/old/build/runtime/libsupine_runtime.so "$work"/new/build/runtime/libsupine_runtime.so
