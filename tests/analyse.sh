#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Run static analysis: tests/analyse.sh [cppcheck|clang-tidy|clang]
#
# Run cppcheck and clang-tidy (.clang-tidy) on every source, and build everything by clang with warnings as
# errors. An argument selects one of the three. Print nothing and exit with 0 if nothing is found.
set -eu
cd "$(dirname "$0")/.."
what=${1:-all}
mkdir -p build
if [ "$what" = all ] || [ "$what" = cppcheck ]; then
  cppcheck --std=c11 --enable=warning,performance,portability --inline-suppr --quiet --error-exitcode=1 \
    --suppress=missingIncludeSystem --suppressions-list=tests/cppcheck.supp \
    -I . -I runtime/include -D_XOPEN_SOURCE=700 sh mesh precompute runtime program packaging
fi
if [ "$what" = all ] || [ "$what" = clang ] || [ "$what" = clang-tidy ]; then
  cmake -S . -B build/clang -G Ninja -DCMAKE_C_COMPILER=clang -DCMAKE_BUILD_TYPE=Debug \
    -DSUPINE_WERROR=ON >build/clang.log
fi
if [ "$what" = all ] || [ "$what" = clang ]; then
  cmake --build build/clang >>build/clang.log || { grep -E 'error|warning' build/clang.log; exit 1; }
fi
if [ "$what" = all ] || [ "$what" = clang-tidy ]; then
  command -v clang-tidy >/dev/null || { echo "clang-tidy is not installed: install it, or give cppcheck or clang"; exit 1; }
  # Include analyse.h first in all sources of the build, except status.c, which defines supine_error_set.
  {
    sed -n 's|^ *"file": "\(.*\)",*$|\1|p' build/clang/compile_commands.json | sort -u |
      grep -E "^$PWD/(base|sh|mesh|precompute|runtime|program|packaging)/" | grep -v '/base/status\.c$' |
      xargs -P "$(nproc)" -n 4 clang-tidy --quiet -p build/clang --extra-arg=-include \
        --extra-arg="$PWD/tests/analyse.h"
    clang-tidy --quiet -p build/clang base/status.c
  } 2>/dev/null | grep -E ': (warning|error): ' | sort -u |
    awk -v root="$PWD/" 'NR == FNR { known[$1]; next }
      {
        file = substr($0, length(root) + 1); sub(/:.*/, "", file)
        check = $0; sub(/.*\[/, "", check); sub(/[],].*/, "", check)
        if (!(check ":" file in known)) { print; found = 1 }
      }
      END { exit found }' tests/clang-tidy.supp -
fi
