#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Run the tests that compare text, numbers or time (label "anywhere") as on other processors, with OpenBLAS's kernels for
# old processors and each of the library's own kernels; on one processor; and beside six busy loops. This takes about four
# minutes on two processors. First build the project: sh cmake/debian.sh build
set -u
cd "$(dirname "$0")/.." || exit 1
failed=""
loops=""
# shellcheck disable=SC2086
trap '[ -z "$loops" ] || kill $loops' EXIT
trap 'exit 1' INT TERM

# Return whether this processor has an instruction set of the library.
has() {
  SUPINE_SIMD=$1 build/release/supine info tests/golden/basis_lungs.safetensors >/dev/null 2>&1
}

# run NAME COMMAND...: run the tests by a command, such as "env NAME=VALUE ctest".
run() {
  name=$1
  shift
  echo "== $name"
  "$@" --preset release -L '^anywhere$' || failed="$failed; $name"
}

# As on other processors. The page in the browser does not depend on kernels.
run "Nehalem, portable" env OPENBLAS_CORETYPE=Nehalem SUPINE_SIMD=portable ctest -j 2 -E '^stream_page$'
if has avx2; then
  run "Haswell, avx2" env OPENBLAS_CORETYPE=Haswell SUPINE_SIMD=avx2 ctest -j 2 -E '^stream_page$'
else
  echo "not tried: Haswell, avx2: this processor lacks AVX2"
fi
simd=auto
if has avx512; then
  simd=avx512
else
  echo "not tried: avx512: this processor lacks AVX-512"
fi
run "Prescott, $simd" env OPENBLAS_CORETYPE=Prescott SUPINE_SIMD=$simd ctest -j 2 -E '^stream_page$'

# On the first of the processors that this process may use.
first=$(taskset -pc $$ | sed 's/.*: //; s/[,-].*//')
run "one processor" taskset -c "$first" ctest -E '^stream_page$' # Chromium takes minutes there

for _ in 1 2 3 4 5 6; do
  timeout 600 sh -c 'while :; do :; done' &
  loops="$loops $!"
done
run "beside six busy loops" ctest -j 2

[ -z "$failed" ] || echo "failed: ${failed#; }"
[ -z "$failed" ]
