#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Build supine.wasm, and compare it with its text in the sources, or exit with 77 (skipped) if a tool is missing. Another
# compiler makes other bytes: wasm.sh CMAKE SOURCE_FOLDER
set -eu
cmake=$1 source=$2
skip() {
  echo "skipped: $1"
  exit 77
}
for tool in clang wasm-ld wasm-opt; do
  command -v $tool >/dev/null || skip "no $tool"
done
[ -f /usr/lib/wasm32-wasi/libc.a ] || skip "no wasi-libc"
[ -f "$(clang --target=wasm32-wasi -print-libgcc-file-name)" ] || skip "no libclang-rt-dev-wasm32"
made_by="clang 14.0.6, wasm-opt 108"
found="clang $(clang -dumpversion), $(wasm-opt --version 2>/dev/null | sed 's/ version//; s/ (.*//')"
[ "$found" = "$made_by" ] || skip "supine.wasm.base64 was made by $made_by, not $found"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$cmake" -S "$source" -B "$work" -G Ninja --toolchain "$source/cmake/wasm.cmake" -DSUPINE_RUNTIME_ONLY=ON \
  -DCMAKE_BUILD_TYPE=MinSizeRel >"$work/log"
"$cmake" --build "$work" --target supine_wasm >>"$work/log"
if ! base64 -w 120 "$work/runtime/js/supine.wasm" | cmp -s - "$source/runtime/js/supine.wasm.base64"; then
  echo "runtime/js/supine.wasm.base64 is not of these sources: make it with cmake --build BUILD --target wasm_text" >&2
  exit 1
fi
