# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(disease supine_precompute GSL::gsl GSL::gslcblas)
supine_test(expandability supine_precompute GSL::gsl GSL::gslcblas)
supine_test(tissue_command supine_commands GSL::gsl)
supine_test(breathe supine_commands GSL::gsl GSL::gslcblas)
supine_test(reach supine_precompute GSL::gsl GSL::gslcblas)
supine_test(validation_network supine_precompute GSL::gsl GSL::gslcblas)
supine_test(validation_lungs supine_precompute GSL::gsl GSL::gslcblas)
