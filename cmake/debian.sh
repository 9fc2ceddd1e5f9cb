#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# On a bare Debian 12, as root, install the packages that are needed, and then
#   sh cmake/debian.sh demo    build; precompute, deform and draw real lungs
#   sh cmake/debian.sh build   build the program and the tests
#   sh cmake/debian.sh test    build, and run the quick tests: a test of each part
#   sh cmake/debian.sh test all   build, and run every test
#   sh cmake/debian.sh anywhere   build, and run tests as on other processors, on one, and on a busy machine
#   sh cmake/debian.sh platforms   build the library also for musl, aarch64 and Windows, and run it
#   sh cmake/debian.sh count   print the lines that the quick tests do not reach
set -eu
cd "$(dirname "$0")/.."

# Packages needed to build, by the quick tests, and by all tests, of which those of other platforms are a command of their own.
build="gcc libc6-dev cmake ninja-build pkg-config libfftw3-dev libgsl-dev libassimp-dev libjansson-dev
  libopenblas-dev liblapacke-dev libsuitesparse-dev libxxhash-dev libcairo2-dev libpango1.0-dev libwebp-dev
  libwebsockets-dev libnifti2-dev zlib1g-dev libdeflate-dev
  libmeshoptimizer-dev help2man"
quick="g++ libegl-dev libgles-dev libgl1-mesa-dri libcmocka-dev libopenigtlink-dev mono-mcs mono-runtime
  python3-yaml python3-numpy python3-nibabel python3-pip python3-setuptools python3-wheel"
all="poppler-utils locales python3-vtk9 plastimatch elastix tetgen calculix-ccx reuse abigail-tools
  clang lld wasi-libc libclang-rt-dev-wasm32 binaryen gcc-aarch64-linux-gnu libc6-dev-arm64-cross doxygen
  cmark-gfm dcmtk python3-pydicom zsh fish"
platforms="clang musl-tools gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user gcc-mingw-w64-x86-64-win32 wine64 wine"

install_missing() {
  missing=""
  for package in "$@"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' ||
      missing="$missing $package"
  done
  if [ -n "$missing" ]; then
    echo "installing$missing"
    apt-get update -qq
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing
  fi
}

# Build the program and the tests, which open exported files in node and Chromium: install each only if it is not on PATH.
build_tests() {
  command -v npm >/dev/null || quick="$quick nodejs npm"
  command -v chromium >/dev/null || quick="$quick chromium"
  # shellcheck disable=SC2086
  install_missing $build $quick "$@"
  [ -d tests/export/node_modules/vtk.js ] && [ -d tests/export/node_modules/tinyusdz ] ||
    npm install --prefix tests/export --no-package-lock --no-audit --no-fund --silent ||
    echo "npm could not install vtk.js and other packages: tests that need them are skipped" >&2
  cmake --preset release -DBUILD_TESTING=ON
  cmake --build --preset release
}

# One test more than processors at a time, as some tests wait for servers and pages.
at_a_time="-j $(($(nproc) + 1))"

echo "sh cmake/debian.sh $*: check the packages"
# shellcheck disable=SC2086
case "$*" in
count)
  install_missing $build $quick gcovr
  exec timeout -k 10 600 sh tests/coverage.sh quick
  ;;
demo)
  install_missing $build
  cmake --preset release -DBUILD_TESTING=OFF
  cmake --build --preset release
  exec sh cmake/demo.sh build/release/supine demo
  ;;
build)
  build_tests
  ;;
test)
  build_tests
  exec ctest --preset release $at_a_time -L '^quick$'
  ;;
"test all")
  build_tests $all $platforms
  exec ctest --preset release $at_a_time
  ;;
anywhere)
  build_tests
  exec sh tests/anywhere.sh
  ;;
platforms)
  build_tests $platforms
  exec ctest --preset release $at_a_time -R '^platform_'
  ;;
*)
  echo "usage: sh cmake/debian.sh demo|build|test|test all|anywhere|platforms|count" >&2
  exit 1
  ;;
esac
