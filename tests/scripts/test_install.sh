#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Install the libraries to an empty folder, and build the examples with them by CMake and by pkg-config. Check the
# dependencies and the exported names of the libraries.
#
#     test_install.sh CMAKE BUILD_FOLDER EXAMPLE_FOLDER MAKE_BASIS CC CXX
set -eu
cmake=$1 build=$2 example=$3 make_basis=$4 cc=$5 cxx=$6
unset SUPINE_THREADS
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
prefix=$work/prefix
"$cmake" --install "$build" --prefix "$prefix" --component runtime >"$work/log"
"$make_basis" "$work/basis.safetensors"

check() {
  "$@" "$work/basis.safetensors" prone:scan+5 >"$work/out" || { echo "failed: $*"; exit 1; }
  grep -q '^100 vertices; the first is at' "$work/out" || { cat "$work/out"; exit 1; }
}

# Build the example by CMake, which finds the headers only in the installed package.
CC=$cc CXX=$cxx "$cmake" -S "$example" -B "$work/build" -G Ninja -DCMAKE_PREFIX_PATH="$prefix" >>"$work/log"
"$cmake" --build "$work/build" >>"$work/log"
check "$work/build/example_static"
check "$work/build/example_shared"
"$work/build/header_cpp"

# Build the example with the flags that pkg-config prints.
PKG_CONFIG_PATH=$(dirname "$(find "$prefix" -name supine-runtime.pc)")
export PKG_CONFIG_PATH
lib=$(dirname "$PKG_CONFIG_PATH")
# shellcheck disable=SC2046
"$cc" -std=c17 -Wall -Wextra -Werror "$example/example.c" $(pkg-config --cflags --libs supine-runtime) -o "$work/shared"
check env LD_LIBRARY_PATH="$lib" "$work/shared"
# shellcheck disable=SC2046
"$cc" -std=c17 "$example/example.c" $(pkg-config --cflags supine-runtime) "$lib/libsupine_runtime.a" -lm -o "$work/static"
check "$work/static"
"$work/static" "$work/basis.safetensors" pron 2>"$work/out" && exit 1
grep -q "'prone'?" "$work/out"

# The library needs only libc and libm, not FFTW, GSL or assimp.
needed=$(objdump -p "$lib/libsupine_runtime.so" | awk '/NEEDED/ {print $2}' | sort | tr '\n' ' ')
case $needed in
"libc.so.6 libm.so.6 " | "ld-linux-x86-64.so.2 libc.so.6 libm.so.6 " | "libc.so.6 ") ;;
*) echo "needs $needed"; exit 1 ;;
esac

# The shared library exports only names that begin with supine_, each with a version.
nm -D --defined-only "$lib/libsupine_runtime.so" | awk '{print $3}' >"$work/names"
grep -q '^supine_deform@@SUPINE_0$' "$work/names"
if grep -Ev '^(supine_[a-z0-9_]*@@SUPINE_0|SUPINE_0.*)$' "$work/names"; then exit 1; fi
# Each installed header compiles alone, in C and in C++, and mentions no header that is not installed. The shared
# library exports exactly the functions that these headers declare.
for header in "$prefix"/include/supine/*.h; do
  name=supine/$(basename "$header")
  grep -q '^ \* Stability: ' "$header" || { echo "$name does not state its stability" >&2; exit 1; }
  printf '#include <%s>\n' "$name" >"$work/one.c"
  cp "$work/one.c" "$work/one.cc"
  "$cc" -std=c17 -Wall -Wextra -Wpedantic -Werror -fsyntax-only -I"$prefix/include" "$work/one.c"
  "$cxx" -Wall -Wextra -Wpedantic -Werror -fsyntax-only -I"$prefix/include" "$work/one.cc"
  cat "$work/one.c"
done >"$work/all.c"
sed -n 's/^\(supine_[a-z0-9_]*\)@@.*/\1/p' "$work/names" | sort >"$work/shown"
"$cc" -std=c17 -E -P -I"$prefix/include" "$work/all.c" | grep -o 'supine_[a-z0-9_]*(' | tr -d '(' |
  sort -u >"$work/declared"
diff "$work/declared" "$work/shown" || { echo "headers and library disagree"; exit 1; }
cat "$prefix"/include/supine/*.h | grep -o '[A-Za-z0-9_./]*\.h\b' | sort -u | while read -r named; do
  case $named in
  std*.h) ;;
  *) [ -f "$prefix/include/$named" ] || { echo "a header cites $named, which is not installed"; exit 1; } ;;
  esac
done
if grep -wn 'FILE' "$prefix"/include/supine/*.h; then echo "a header needs stdio"; exit 1; fi
# The static library defines only names that begin with supine_.
nm --defined-only --extern-only "$lib/libsupine_runtime.a" | awk 'NF == 3 {print $3}' >"$work/names"
if grep -v '^supine_' "$work/names"; then exit 1; fi

# The static library uses no functions of FFTW, GSL, assimp, threads or BLAS.
nm --undefined-only "$lib/libsupine_runtime.a" | awk '{print $2}' | sort -u >"$work/undefined"
if grep -Ei 'fftw|gsl_|assimp|^ai[A-Z]|pthread|cblas' "$work/undefined"; then exit 1; fi

# The offline library makes a basis from arrays. CMake finds it once it is installed, and refuses it as a component before.
"$cmake" -S "$example" -B "$work/missing" -G Ninja -DCMAKE_PREFIX_PATH="$prefix" -DNEEDED=precompute >"$work/out" 2>&1 && exit 1
grep -q 'precompute' "$work/out"
"$cmake" --install "$build" --prefix "$prefix" --component precompute >>"$work/log"
CC=$cc CXX=$cxx "$cmake" -S "$example" -B "$work/offline" -G Ninja -DCMAKE_PREFIX_PATH="$prefix" -DNEEDED=precompute >>"$work/log"
"$cmake" --build "$work/offline" >>"$work/log"
"$build/supine" phantom --vertices 1000 -o "$work/lungs.ply" >>"$work/log"
/usr/bin/python3 - "$work/lungs.ply" >"$work/lungs.txt" <<'EOF'
import re, struct, sys
data = open(sys.argv[1], "rb").read()
at = data.index(b"end_header\n") + len("end_header\n")
n, m = (int(x) for x in re.findall(rb"element \w+ (\d+)", data[:at]))
width = 4 if re.search(rb"property float x", data[:at]) else 8
print(n, m)
print(*struct.unpack_from(f"<{3 * n}{'f' if width == 4 else 'd'}", data, at))
for t in range(m):
    print(*struct.unpack_from("<3I", data, at + 3 * width * n + 13 * t + 1))
EOF
# shellcheck disable=SC2046
"$cc" -std=c17 -Wall -Wextra -Werror "$example/offline.c" $(pkg-config --cflags --libs supine-precompute) -o "$work/by_flags"
for program in offline/offline_static offline/offline_shared by_flags; do
  LD_LIBRARY_PATH=$lib "$work/$program" "$work/lungs.txt" >"$work/out" || { cat "$work/out"; echo "failed: $program"; exit 1; }
  grep -q ' vertices, [1-8] modes$' "$work/out" || { cat "$work/out"; exit 1; }
done
nm -D --defined-only "$lib/libsupine_precompute.so" | awk '$2 == "T" {print $3}' | sed 's/@@.*//' | sort >"$work/shown"
"$cc" -std=c17 -E -P -I"$prefix/include" -include supine/precompute.h -x c /dev/null |
  grep -o 'supine_precompute_[a-z0-9_]*(' | tr -d '(' | sort -u | diff - "$work/shown"
# The static library has no part of the program, which alone reads options.
nm --defined-only --extern-only "$lib/libsupine_precompute.a" | awk 'NF == 3 {print $3}' >"$work/names"
grep -q '^supine_precompute_basis$' "$work/names"
find "$build/program" -name 'libsupine_*.a' ! -name 'libsupine_precompute.a' -exec nm --defined-only --extern-only {} + |
  awk 'NF == 3 {print $3}' | sort -u >"$work/program"
[ -s "$work/program" ]
if sort -u "$work/names" | comm -12 - "$work/program" | grep .; then echo "the library has symbols of the program"; exit 1; fi
if nm --undefined-only "$lib/libsupine_precompute.a" | grep -E ' getopt|mkdtemp|fmemopen'; then exit 1; fi
for header in "-x c -std=c17" "-x c++"; do
  # shellcheck disable=SC2086
  "$cxx" -Wall -Wextra -Wpedantic -Werror -fsyntax-only -I"$prefix/include" -include supine/precompute.h $header /dev/null
done
