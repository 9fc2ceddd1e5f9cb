#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Which lines the tests reach: tests/coverage.sh [quick]
#
# Builds with gcov's counters, runs the tests, in two minutes the quick ones alone, and prints the
# lines of each file that none reaches and the share of all. Wants gcovr (Debian has it). Ends with 1
# below the share that is promised, 90 % in all; of the quick tests it is a lower bound.
set -eu
cd "$(dirname "$0")/.."
# What reaches little that others do not, for the time that counting makes of it.
slow='precompute|thread_count|field|patient_expand|program|breathe|projection|deform|deform_lung|cohort'
slow="$slow|inside|no_data_lost|labels_orientation|postures|lit_angles|faults|bids|reference|validation_lungs|house"
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
