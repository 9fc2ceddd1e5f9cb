#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Check that two builds of the last commit, in different folders and at different times, install the same bytes.
#
#     tests/reproducible.sh
#
# The date in the changelog of the package is taken from SOURCE_DATE_EPOCH, as in other reproducible builds.
set -eu
source=$(cd "$(dirname "$0")/.." && pwd)
SOURCE_DATE_EPOCH=$(git -C "$source" log -1 --format=%ct)
export SOURCE_DATE_EPOCH
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for place in one/here another/place/altogether; do
  mkdir -p "$work/$place"
  git -C "$source" archive HEAD | tar -x -C "$work/$place"
  (cd "$work/$place" && cmake --preset package && cmake --build --preset package &&
    DESTDIR="$work/$place/installed" cmake --install build/package) >"$work/log" 2>&1 ||
    { tail -20 "$work/log"; exit 1; }
  (cd "$work/$place/installed" && find . -type f | LC_ALL=C sort | xargs sha256sum) >"$work/$(basename "$place").sums"
done
if cmp "$work/here.sums" "$work/altogether.sums"; then
  echo "$(wc -l <"$work/here.sums") installed files, same bytes from both folders"
else
  diff "$work/here.sums" "$work/altogether.sums"
  exit 1
fi
