#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# On a bare Debian 12, as root, install the packages that are needed, and then
#   sh cmake/debian.sh demo    build; precompute, deform and draw real lungs
#   sh cmake/debian.sh build   build the program and the tests
#   sh cmake/debian.sh test    build, and run the tests
#   sh cmake/debian.sh anywhere   build, and run tests as on other processors, on one, and on a busy machine
#   sh cmake/debian.sh platforms   build the library also for musl, aarch64 and Windows, and run it
#   sh cmake/debian.sh count   print the lines that the quick tests do not reach
set -eu
cd "$(dirname "$0")/.."

# Packages needed to build, and further packages needed by the tests.
build="gcc libc6-dev cmake ninja-build pkg-config libfftw3-dev libgsl-dev libassimp-dev libjansson-dev
  libopenblas-dev liblapacke-dev libsuitesparse-dev libxxhash-dev libcairo2-dev libwebp-dev
  libwebsockets-dev libnifti2-dev zlib1g-dev libdeflate-dev
  libmeshoptimizer-dev help2man"
tests="g++ libegl-dev libgles-dev libgl1-mesa-dri poppler-utils libcmocka-dev libopenigtlink-dev mono-mcs mono-runtime
  locales python3-vtk9 python3-yaml python3-numpy python3-nibabel python3-pip python3-setuptools python3-wheel gnuplot-nox
  plastimatch elastix tetgen calculix-ccx clang lld wasi-libc libclang-rt-dev-wasm32
  binaryen reuse abigail-tools gcc-aarch64-linux-gnu libc6-dev-arm64-cross doxygen dcmtk"
platforms="clang musl-tools gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user gcc-mingw-w64-x86-64-win32 wine64 wine"

install_missing() {
  missing=""
  for package in "$@"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' ||
      missing="$missing $package"
  done
  if [ -n "$missing" ]; then
    apt-get update -qq
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing
  fi
}

case "${1-}" in
count)
  # shellcheck disable=SC2086
  install_missing $build $tests gcovr
  exec timeout -k 10 400 sh tests/coverage.sh quick
  ;;
demo)
  # shellcheck disable=SC2086
  install_missing $build
  cmake --preset release -DBUILD_TESTING=OFF
  cmake --build --preset release
  exec sh cmake/demo.sh build/release/supine demo
  ;;
build | test | anywhere | platforms)
  [ "$1" != platforms ] || build="$build $platforms"
  # Tests open exported files in node and Chromium. Install each only if it is not on PATH.
  command -v npm >/dev/null || tests="$tests nodejs npm"
  command -v chromium >/dev/null || tests="$tests chromium"
  # shellcheck disable=SC2086
  install_missing $build $tests
  [ -d tests/export/node_modules/vtk.js ] && [ -d tests/export/node_modules/iwer ] ||
    npm install --prefix tests/export --no-package-lock --no-audit --no-fund --silent ||
    echo "npm could not install vtk.js and other packages: tests that need them are skipped" >&2
  cmake --preset release -DBUILD_TESTING=ON
  cmake --build --preset release
  [ "$1" != platforms ] || exec ctest --preset release -R '^platform_'
  [ "$1" != anywhere ] || exec sh tests/anywhere.sh
  # One test more than processors at a time, as some tests wait for servers and pages.
  [ "$1" = build ] || exec ctest --preset release -j "$(($(nproc) + 1))"
  ;;
*)
  echo "usage: sh cmake/debian.sh demo|build|test|anywhere|platforms|count" >&2
  exit 1
  ;;
esac
