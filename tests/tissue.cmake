# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(precompute/disease supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(precompute/expandability supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(program/tissue_command supine_commands supine_gsl)
supine_test(program/breathe supine_commands supine_gsl)
supine_test(precompute/reach supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(precompute/validation_network supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(precompute/validation_lungs supine_precompute supine_lungs supine_mesh_io supine_gsl)

# Read the file of a breath (a series of surfaces) by VTK, if Debian's Python has VTK.
add_test(NAME series_vtk COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_series_vtk.py
  $<TARGET_FILE:supine>)
set_tests_properties(series_vtk PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
