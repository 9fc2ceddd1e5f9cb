# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(disease supine_precompute supine_gsl)
supine_test(expandability supine_precompute supine_gsl)
supine_test(tissue_command supine_commands supine_gsl)
supine_test(breathe supine_commands supine_gsl)
supine_test(reach supine_precompute supine_gsl)
supine_test(validation_network supine_precompute supine_gsl)
supine_test(validation_lungs supine_precompute supine_gsl)
