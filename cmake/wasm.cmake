# SPDX-License-Identifier: GPL-3.0-or-later
# Toolchain to build the run-time library for WebAssembly with Debian's clang, lld, wasi-libc and
# libclang-rt-dev-wasm32. If binaryen is installed, the result is smaller by a tenth:
#   cmake -S . -B build/wasm --toolchain cmake/wasm.cmake -DSUPINE_RUNTIME_ONLY=ON -DCMAKE_BUILD_TYPE=MinSizeRel
#   cmake --build build/wasm
# The target `npm` of a usual build runs these commands and makes the JavaScript package.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR wasm32)
set(CMAKE_C_COMPILER clang)
set(CMAKE_C_COMPILER_TARGET wasm32-wasi)
set(CMAKE_C_FLAGS_INIT -mbulk-memory) # every browser that supports SIMD, which the library needs, supports it
set(CMAKE_C_FLAGS_MINSIZEREL "-Oz -DNDEBUG" CACHE STRING "")
set(CMAKE_SYSROOT /usr) # clang searches include/wasm32-wasi and lib/wasm32-wasi there
# Use xxhash.h of the host, as it contains the whole implementation.
set(SUPINE_XXHASH_HEADER /usr/include/xxhash.h CACHE FILEPATH "xxhash.h")
