#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Which lines the tests reach: tests/coverage.sh [CTEST OPTIONS]
#
# Builds with gcov's counters, runs the tests and prints the share of lines of each room and of all.
# Wants gcovr (Debian has it). Ends with 1 below the share that is promised, 90 % in all.
set -eu
cd "$(dirname "$0")/.."
cmake --preset coverage >build/coverage.log
cmake --build --preset coverage >>build/coverage.log
find build/coverage -name '*.gcda' -delete
ctest --preset coverage "$@" >build/coverage.ctest.log || echo "some tests failed: build/coverage.ctest.log"
exec gcovr --root . build/coverage --filter '(sh|mesh|precompute|runtime)/' --gcov-ignore-parse-errors \
  --exclude-unreachable-branches --fail-under-line 90 --print-summary
