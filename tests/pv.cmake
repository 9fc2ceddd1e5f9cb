# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(pv_curve supine_breath supine_gsl)
supine_test(pv_fit supine_breath supine_gsl)
supine_test(pv_file supine_breath supine_gsl)
supine_test(pv_breath supine_breath supine_gsl)
