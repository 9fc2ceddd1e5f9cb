# SPDX-License-Identifier: GPL-3.0-or-later
supine_test(compare runtime_fixture)
