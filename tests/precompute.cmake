# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(equilibrium supine_precompute supine_phantom supine_mesh_read supine_gsl umfpack)
supine_test(force supine_precompute supine_phantom supine_mesh_read)
supine_test(lungs supine_precompute supine_phantom supine_mesh_read)
supine_test(precompute supine_precompute supine_phantom supine_mesh_read umfpack)
supine_test(program supine_sh_basis)
target_compile_definitions(test_program PRIVATE SUPINE_PROGRAM="$<TARGET_FILE:supine>")
supine_test(projection supine_precompute supine_phantom supine_mesh_read supine_gsl)
supine_test(fields supine_precompute supine_phantom supine_mesh_read supine_mesh_save supine_safetensors_write)
