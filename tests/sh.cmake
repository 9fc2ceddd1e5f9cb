# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(base supine_base)
supine_test(sh_basis supine::sh m)
supine_test(sh_grid supine::sh m)
supine_test(transform supine::sh m)
target_link_options(test_transform PRIVATE -Wl,--wrap=malloc,--wrap=calloc,--wrap=aligned_alloc)
supine_test(aliasing supine::sh m)
