# SPDX-License-Identifier: GPL-3.0-or-later

# Made bases, and reference evaluations of them.
add_library(runtime_fixture STATIC runtime_fixture.c)
target_link_libraries(runtime_fixture
  PRIVATE supine_options PkgConfig::CMOCKA
  PUBLIC supine_runtime supine_safetensors_write)

supine_test(safetensors runtime_fixture)
supine_test(posture runtime_fixture)
supine_test(volume runtime_fixture)
supine_test(runtime_basis runtime_fixture)
supine_test(deform runtime_fixture)
supine_test(deform_lung runtime_fixture)
