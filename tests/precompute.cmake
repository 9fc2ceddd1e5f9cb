# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(precompute/equilibrium supine_precompute supine_lungs supine_mesh_io supine_gsl umfpack)
supine_test(precompute/inverse supine_precompute supine_lungs supine_mesh_io)
supine_test(precompute/force supine_precompute supine_lungs supine_mesh_io)
supine_test(precompute/lit_angles supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(precompute/deform_lung supine_precompute supine_lungs supine_mesh_io)
# Effects of posture and breathing on real lungs are within the ranges that evidence.py prints.
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE)
  add_test(NAME evidence COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/evidence/evidence.py --check
    ${PROJECT_BINARY_DIR} ${SUPINE_LUNGS}/lungs ${SUPINE_LUNGS}/covid:RAS)
  set_tests_properties(evidence PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
endif()
# Printed positions lie within their stated errors, and the term of another day is that of landmarks.
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE)
  add_test(NAME positions COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/evidence/positions.py ${PROJECT_BINARY_DIR}
    ${SUPINE_LUNGS}/copd)
  add_test(NAME sessions COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/evidence/sessions.py
    ${PROJECT_SOURCE_DIR}/runtime/include/supine/locate.h ${SUPINE_LUNGS}/sessions)
  set_tests_properties(positions sessions PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
endif()
# Fields that CalculiX computes are compressed within the error that is stated.
if(NOT SUPINE_SANITIZE AND NOT SUPINE_COVERAGE)
  add_test(NAME fem COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/evidence/fem.py ${PROJECT_BINARY_DIR})
  set_tests_properties(fem PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
endif()
supine_test(precompute/reference supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(precompute/lungs supine_precompute supine_lungs supine_mesh_io)
supine_test(precompute/precompute supine_precompute supine_lungs supine_mesh_io umfpack)
supine_test(program/program supine_status)
target_compile_definitions(test_program PRIVATE SUPINE_PROGRAM="$<TARGET_FILE:supine>")
supine_test(program/process supine_commands supine_gsl)
target_compile_definitions(test_process PRIVATE SUPINE_PROGRAM="$<TARGET_FILE:supine>")
# Compare the complete output of the commands with golden files.
add_test(NAME command_output COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_command_output.sh
  $<TARGET_FILE:supine> ${CMAKE_CURRENT_SOURCE_DIR}/golden)
add_test(NAME same_output COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_same_output.py)
set_tests_properties(command_output PROPERTIES TIMEOUT ${hang})
# Run the commands that README.md and FIGURES.md quote.
add_test(NAME quoted COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_quoted.py $<TARGET_FILE:supine>
  ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR})
add_test(NAME printed COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_printed.py $<TARGET_FILE:supine>)
# Check manual pages and completions, which are made from the tables of options.
add_test(NAME manual COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_manual.sh $<TARGET_FILE:supine>
  ${PROJECT_BINARY_DIR}/packaging/manual)
# Run the cohort workflow on forty subjects, if snakemake is installed.
add_test(NAME cohort COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_cohort.sh $<TARGET_FILE:supine>
  ${PROJECT_SOURCE_DIR}/cohort)
set_tests_properties(cohort PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
# Run a plan of simulations, and collect the fields.
add_test(NAME simulations COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_simulations.sh $<TARGET_FILE:supine>
  ${PROJECT_SOURCE_DIR}/cohort)
set_tests_properties(simulations PROPERTIES TIMEOUT ${hang})
# Run the BIDS app on a small dataset.
if(Python3_FOUND)
  add_test(NAME bids COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_bids.sh $<TARGET_FILE:supine>
    ${PROJECT_SOURCE_DIR}/cohort)
  add_test(NAME cohort_refused COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_cohort_refused.sh $<TARGET_FILE:supine>
    ${PROJECT_SOURCE_DIR}/cohort)
  set_tests_properties(bids cohort_refused PROPERTIES TIMEOUT ${hang})
  set_tests_properties(cohort_refused PROPERTIES SKIP_RETURN_CODE 77)
endif()
add_test(NAME no_data_lost COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_no_data_lost.sh
  $<TARGET_FILE:supine>)
set_tests_properties(no_data_lost PROPERTIES TIMEOUT ${hang})
supine_test(base/thread_count supine_precompute supine_lungs)
supine_test(precompute/torture supine_precompute supine_lungs supine_mesh_io)
supine_test(precompute/projection supine_precompute supine_lungs supine_mesh_io supine_gsl)
supine_test(precompute/library supine_precompute supine_lungs supine_mesh_io supine_runtime)
supine_test(precompute/fields supine_precompute supine_fields supine_lungs supine_mesh_io supine_runtime)
supine_test(precompute/fields_volume supine_precompute supine_fields supine_lungs supine_mesh_io supine_runtime m)
target_compile_definitions(test_fields PRIVATE SUPINE_PROGRAM="$<TARGET_FILE:supine>")
