# SPDX-License-Identifier: GPL-3.0-or-later
# The run-time library for WebAssembly, from Debian's clang, lld, wasi-libc and libclang-rt-dev-wasm32, smaller by a
# tenth with binaryen:
#   cmake -S . -B build/wasm --toolchain cmake/wasm.cmake -DSUPINE_RUNTIME_ONLY=ON -DCMAKE_BUILD_TYPE=MinSizeRel
#   cmake --build build/wasm
# The target `npm` of any other build does this and makes the package for JavaScript.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR wasm32)
set(CMAKE_C_COMPILER clang)
set(CMAKE_C_COMPILER_TARGET wasm32-wasi)
set(CMAKE_C_FLAGS_INIT -mbulk-memory) # every browser with 128-bit vectors, which the kernel uses, has it
set(CMAKE_C_FLAGS_MINSIZEREL "-Oz -DNDEBUG" CACHE STRING "")
set(CMAKE_SYSROOT /usr) # clang searches its include/wasm32-wasi and lib/wasm32-wasi
# xxhash.h contains the whole implementation, so the host's serves.
set(SUPINE_XXHASH_HEADER /usr/include/xxhash.h CACHE FILEPATH "xxhash.h")
