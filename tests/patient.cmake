# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(patient supine_patient supine_base supine_gsl)
