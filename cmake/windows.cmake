# SPDX-License-Identifier: GPL-3.0-or-later
# Toolchain to build the run-time library for Windows with Debian's gcc-mingw-w64-x86-64-win32:
#   cmake -S . -B build/windows --toolchain cmake/windows.cmake -DSUPINE_RUNTIME_ONLY=ON
#   cmake --build build/windows
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR x86_64)
set(CMAKE_C_COMPILER x86_64-w64-mingw32-gcc)
set(CMAKE_FIND_ROOT_PATH /usr/x86_64-w64-mingw32)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
# Use xxhash.h of the host, as it contains the whole implementation.
set(SUPINE_XXHASH_HEADER /usr/include/xxhash.h CACHE FILEPATH "xxhash.h")
