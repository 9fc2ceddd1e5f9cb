#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Make the JavaScript package, or exit with 77 (skipped) if a tool is missing: package.sh CMAKE BUILD_FOLDER TARBALL
set -eu
cmake=$1 build=$2 tarball=$3
rm -f "$tarball"
skip() {
  echo "skipped: $1"
  exit 77
}
for tool in clang wasm-ld; do
  command -v $tool >/dev/null || skip "no $tool"
done
[ -f /usr/lib/wasm32-wasi/libc.a ] || skip "no wasi-libc"
[ -f "$(clang --target=wasm32-wasi -print-libgcc-file-name)" ] || skip "no libclang-rt-dev-wasm32"
"$cmake" --build "$build" --target npm
tar tzf "$tarball" | sort
[ "$(tar tzf "$tarball" | grep -c '^package/\(supine.js\|supine.wasm\|supine.d.ts\|package.json\|README.md\)$')" = 5 ]
