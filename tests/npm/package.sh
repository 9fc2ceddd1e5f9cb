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
# The text of supine.wasm that pages contain is that of the sources. Another compiler makes other bytes.
text=$(dirname "$0")/../../runtime/js/supine.wasm.base64
made_by="clang 14.0.6, wasm-opt 108"
found="clang $(clang -dumpversion), $(wasm-opt --version 2>/dev/null | sed 's/ version//; s/ (.*//')"
if [ "$found" != "$made_by" ]; then
  echo "supine.wasm.base64 was made by $made_by, not $found: not compared"
elif ! tar xzOf "$tarball" package/supine.wasm | base64 -w 120 | cmp -s - "$text"; then
  echo "runtime/js/supine.wasm.base64 is not of these sources: make it with cmake --build BUILD --target wasm_text" >&2
  exit 1
fi
