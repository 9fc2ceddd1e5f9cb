# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(compare runtime_fixture)

# Prints how long comparisons take; CTest does not run it.
add_executable(bench_compare bench/bench_compare.c)
target_link_libraries(bench_compare PRIVATE supine_options supine_commands GSL::gsl)
