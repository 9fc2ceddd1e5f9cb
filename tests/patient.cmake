# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(precompute/patient supine_commands supine_patient supine_base supine_gsl)
supine_test(precompute/patient_surface supine_patient supine_lungs supine_mesh_io supine_base supine_gsl)
supine_test(precompute/patient_expand supine_patient supine_lungs supine_mesh_io supine_base supine_gsl)
supine_test(precompute/patient_memory supine_patient supine_lungs supine_base supine_gsl)
target_link_options(test_patient_memory PRIVATE -Wl,--wrap=malloc,--wrap=calloc)
add_test(NAME patient_command COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_patient_command.sh
  $<TARGET_FILE:supine>)
set_tests_properties(patient_command PROPERTIES TIMEOUT ${hang})
add_test(NAME patient_refused COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_patient_refused.sh
  $<TARGET_FILE:supine>)
set_tests_properties(patient_refused PROPERTIES TIMEOUT ${hang})
