# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(base supine_base)
supine_test(number supine_base m)
supine_test(csv supine_base)
supine_test(sh_basis supine_sh m)
supine_test(sh_grid supine_sh m)
supine_test(transform supine_sh m)
