# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(mesh_topology supine_mesh_io)
supine_test(mesh_measure supine_mesh_io m)
supine_test(mesh_load supine_mesh_io Threads::Threads m)
supine_test(mesh_hostile supine_mesh_io)
supine_test(mesh_save supine_mesh_io ZLIB::ZLIB m)
supine_test(mesh_lungs supine_mesh_io m)
supine_test(mesh_memory supine_mesh_io)
target_link_options(test_mesh_memory PRIVATE -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc)
