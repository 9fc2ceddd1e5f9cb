# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(equilibrium supine_precompute supine_lungs supine_mesh_io supine_gsl umfpack)
supine_test(inverse supine_precompute supine_lungs supine_mesh_io)
supine_test(force supine_precompute supine_lungs supine_mesh_io)
supine_test(lit_angles supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(deform_lung supine_precompute supine_lungs supine_mesh_io)
# Effects of posture and breathing on real lungs are within the ranges that evidence.py prints.
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE)
  add_test(NAME evidence COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/evidence/evidence.py --check
    ${PROJECT_BINARY_DIR} ${SUPINE_LUNGS}/lungs ${SUPINE_LUNGS}/covid:RAS)
  set_tests_properties(evidence PROPERTIES TIMEOUT 600 SKIP_RETURN_CODE 77)
endif()
# Fields that CalculiX computes are compressed within the error that is stated.
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE)
  add_test(NAME fem COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/evidence/fem.py ${PROJECT_BINARY_DIR})
  set_tests_properties(fem PROPERTIES TIMEOUT 600 SKIP_RETURN_CODE 77)
endif()
supine_test(reference supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(lungs supine_precompute supine_lungs supine_mesh_io)
supine_test(precompute supine_precompute supine_lungs supine_mesh_io umfpack)
supine_test(program supine_status)
target_compile_definitions(test_program PRIVATE SUPINE_PROGRAM="$<TARGET_FILE:supine>")
# Compare the complete output of the commands with golden files.
add_test(NAME command_output COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/test_command_output.sh
  $<TARGET_FILE:supine> ${CMAKE_CURRENT_SOURCE_DIR}/golden)
set_tests_properties(command_output PROPERTIES TIMEOUT 900)
# Run the commands that README.md and FIGURES.md quote.
add_test(NAME quoted COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/test_quoted.py $<TARGET_FILE:supine>
  ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR})
# Check manual pages and completions, which are made from the tables of options.
add_test(NAME manual COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/test_manual.sh $<TARGET_FILE:supine>
  ${PROJECT_BINARY_DIR}/packaging/manual)
# Run the cohort workflow on forty subjects, if snakemake is installed.
add_test(NAME cohort COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/test_cohort.sh $<TARGET_FILE:supine>
  ${PROJECT_SOURCE_DIR}/cohort)
set_tests_properties(cohort PROPERTIES TIMEOUT 900 SKIP_RETURN_CODE 77)
# Run the BIDS app on a small dataset.
if(Python3_FOUND)
  add_test(NAME bids COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/test_bids.sh $<TARGET_FILE:supine>
    ${PROJECT_SOURCE_DIR}/cohort)
  set_tests_properties(bids PROPERTIES TIMEOUT 900)
endif()
add_test(NAME no_data_lost COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/test_no_data_lost.sh
  $<TARGET_FILE:supine>)
set_tests_properties(no_data_lost PROPERTIES TIMEOUT 900)
supine_test(thread_count supine_precompute supine_lungs)
supine_test(torture supine_precompute supine_lungs supine_mesh_io)
supine_test(projection supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(library supine_precompute supine_lungs supine_mesh_io supine_runtime)
supine_test(fields supine_precompute supine_fields supine_lungs supine_mesh_io supine_runtime)
target_compile_definitions(test_fields PRIVATE SUPINE_PROGRAM="$<TARGET_FILE:supine>")
