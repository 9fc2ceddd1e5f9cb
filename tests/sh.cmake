# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(base/base supine_base)
supine_test(base/number supine_base m)
supine_test(base/csv supine_base)
supine_test(sh/sh_basis supine_sh m)
supine_test(sh/sh_grid supine_sh m)
supine_test(sh/transform supine_sh m)
