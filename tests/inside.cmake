# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(inside supine_inside supine_phantom)
