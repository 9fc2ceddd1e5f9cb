# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(program/pv_curve supine_breath supine_gsl)
supine_test(program/pv_fit supine_breath supine_gsl)
supine_test(program/pv_file supine_breath supine_gsl)
supine_test(runtime/pv_breath supine_breath supine_gsl)
