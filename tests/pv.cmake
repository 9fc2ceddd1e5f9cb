# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(pv_curve supine_pv GSL::gsl)
supine_test(pv_fit supine_pv GSL::gsl)
supine_test(pv_file supine_pv GSL::gsl)
supine_test(pv_breath supine_pv GSL::gsl)
supine_test(pv_command supine_pv GSL::gsl)
target_sources(test_pv_command PRIVATE ${PROJECT_SOURCE_DIR}/precompute/command/pv.c)
