#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Check that the JavaScript package has its files: package.sh TARBALL
set -eu
tar tzf "$1" | sort
[ "$(tar tzf "$1" | grep -c '^package/\(supine.js\|supine.wasm\|supine.d.ts\|package.json\|README.md\)$')" = 5 ]
