# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(equilibrium supine_precompute GSL::gsl GSL::gslcblas umfpack)
supine_test(force supine_precompute)
supine_test(lungs supine_precompute)
supine_test(precompute supine_precompute umfpack)
