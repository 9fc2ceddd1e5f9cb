# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(precompute/inside supine_inside supine_lungs)
supine_test(mesh/image supine_image)
supine_test(mesh/labels supine_labels supine_image supine_inside supine_lungs m)
supine_test(precompute/field supine_inside supine_warp supine_lungs)
supine_test(precompute/compact supine_inside supine_warp supine_lungs)
set_tests_properties(image labels PROPERTIES
  ENVIRONMENT "LSAN_OPTIONS=suppressions=${CMAKE_CURRENT_SOURCE_DIR}/lsan.supp:print_suppressions=0")

# Pass names with commas, quotes and umlauts through all CSV files.
add_test(NAME names COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_names.py $<TARGET_FILE:supine>)

# Compare results with those of nibabel, VTK and other tools that are installed.
add_test(NAME labels_orientation COMMAND /usr/bin/python3
  ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_labels_orientation.py $<TARGET_FILE:supine>)
add_test(NAME segmentation COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_segmentation.py
  $<TARGET_FILE:supine> ${PROJECT_SOURCE_DIR}/examples/lungs ${PROJECT_SOURCE_DIR}/docs/guide)
set_tests_properties(segmentation PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
add_test(NAME foreign_tools COMMAND /usr/bin/python3
  ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_foreign_tools.py $<TARGET_FILE:supine>)
set_tests_properties(foreign_tools PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
add_test(NAME soft_tissue COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_soft_tissue.py
  $<TARGET_FILE:supine> ${PROJECT_SOURCE_DIR}/docs/guide ${SUPINE_LUNGS}/covid/lobes_001.nii.gz)
set_tests_properties(soft_tissue PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
add_test(NAME grid_axes COMMAND /usr/bin/python3
  ${CMAKE_CURRENT_SOURCE_DIR}/scripts/test_grid_axes.py $<TARGET_FILE:supine>)
set_tests_properties(grid_axes PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
set_tests_properties(labels_orientation PROPERTIES TIMEOUT ${hang} SKIP_RETURN_CODE 77)
