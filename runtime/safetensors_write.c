/* SPDX-License-Identifier: MIT */
typedef int supine_placeholder;
