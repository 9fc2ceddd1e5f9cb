#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Count the lines that the tests reach: tests/coverage.sh [quick]
#
# Build with gcov, and run all tests, or those with the label `quick`. Print the lines of each file that no test reaches, and
# the share of lines that the tests reach. Exit with an error if the share is below 90 %. Needs Debian's gcovr.
set -eu
cd "$(dirname "$0")/.."
mkdir -p build
echo "build with gcov, run the tests and count their lines: see build/coverage*.log"
cmake --preset coverage >build/coverage.log
cmake --build --preset coverage >>build/coverage.log
find build/coverage -name '*.gcda' -delete
options=""
[ "${1-}" != quick ] || options="-L ^quick\$"
# shellcheck disable=SC2086
ctest --preset coverage -j "$(nproc)" $options >build/coverage.ctest.log ||
  echo "some tests failed: build/coverage.ctest.log"
exec gcovr --root . build/coverage --filter '(sh|mesh|precompute|runtime|program)/' --gcov-ignore-parse-errors \
  --exclude-unreachable-branches --fail-under-line 90 --print-summary 2>build/coverage.gcovr.log
