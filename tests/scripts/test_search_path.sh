#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Check that no program or library in the given folders searches for libraries in the current folder: its RPATH or
# RUNPATH has no empty and no relative entry but $ORIGIN. With --build, check what is built, installed and packaged.
#
#     test_search_path.sh FOLDER...
#     test_search_path.sh --build CMAKE BUILD_FOLDER
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [ "$1" = --build ]; then
  cmake=$2 build=$3
  "$cmake" --install "$build" --prefix "$work/installed" >"$work/log"
  (cd "$work" && "$(dirname "$cmake")/cpack" --config "$build/CPackConfig.cmake" -B "$work/made") >"$work/log" 2>&1 ||
    { cat "$work/log"; exit 1; }
  dpkg-deb -x "$work"/made/*.deb "$work/packaged"
  rm -r "$work/made"
  set -- "$build" "$work"
  [ -x "$work/installed/bin/supine" ] && [ -n "$(find "$work/packaged" -name supine -type f -perm -u+x)" ]
fi
find "$@" -type f \( -perm -u+x -o -name '*.so*' \) -exec readelf --dynamic --wide /dev/null {} + 2>/dev/null >"$work/list" || true
echo "$(grep -c '^Dynamic section' "$work/list") programs and libraries"
grep -q '^Dynamic section' "$work/list"
awk '/^File: / { file = substr($0, 7) }
  / \((RPATH|RUNPATH)\) / {
    path = $0
    sub(/^[^[]*\[/, "", path)
    sub(/\]$/, "", path)
    count = split(path, entry, ":")
    for (i = 1; i <= (count > 0 ? count : 1); ++i)
      if (entry[i] !~ /^(\/|\$ORIGIN(\/|$)|\$\{ORIGIN\}(\/|$))/) { print file " searches \"" path "\""; bad = 1; break }
  }
  END { exit bad }' "$work/list"
