#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Count the lines that the tests reach: tests/coverage.sh [quick]
#
# Build with gcov, and run all tests. With `quick`, run only tests that together take two minutes. Print the lines of
# each file that no test reaches, and the share of lines that the tests reach. Exit with an error if the share is below
# 90 %. Needs Debian's gcovr.
set -eu
cd "$(dirname "$0")/.."
# The argument `quick` leaves out these tests. They are slow with gcov, and other tests run nearly all of their lines.
slow='precompute|thread_count|field|patient_expand|program|breathe|projection|deform|deform_lung|cohort'
slow="$slow|inside|no_data_lost|labels_orientation|lit_angles|faults|bids|reference|validation_lungs|house"
slow="$slow|readme_example|series_vtk|stream_page|stream_slicer|stream_link|stream_unity.*|export_.*_node|mesh_hostile"
slow="$slow|fuzz_obj|fuzz_nrrd|fuzz_nii"
mkdir -p build
cmake --preset coverage >build/coverage.log
cmake --build --preset coverage >>build/coverage.log
find build/coverage -name '*.gcda' -delete
left_out=none
[ "${1-}" = quick ] && left_out=$slow
ctest --preset coverage -j "$(nproc)" -E "^($left_out)\$" >build/coverage.ctest.log ||
  echo "some tests failed: build/coverage.ctest.log"
exec gcovr --root . build/coverage --filter '(sh|mesh|precompute|runtime|program)/' --gcov-ignore-parse-errors \
  --exclude-unreachable-branches --fail-under-line 90 --print-summary 2>build/coverage.gcovr.log
