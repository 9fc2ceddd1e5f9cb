#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Build every file of a release from a commit of this repository:
#
#     sh packaging/release.sh [REVISION [FOLDER]]
#
# REVISION is by default the tag v<version>, where runtime/include/supine/version.h has the version. A tag of a release
# needs a date in CHANGELOG.md, which is also `date-released` in CITATION.cff; any other commit gives a trial. While
# CHANGELOG.md says "unreleased", CITATION.cff has no date. FOLDER, by default build/dist, must not exist. The same commit gives the same bytes on the same system. The files:
#
#     supine-<version>.tar.gz                            source
#     supine_<version>_amd64.deb                         Debian package
#     supine-<version>-linux-x86_64-glibc<G>.tar.gz      program and its libraries, for any Linux with glibc G or newer
#     supine-<version>-py3-none-manylinux_*.whl          Python packages for x86-64 and aarch64
#     supine-<version>.tgz                               npm package
#     supine-<version>-binaries.spdx.json  .cdx.json     what these files contain and depend on (SPDX, CycloneDX)
#     supine-<version>.spdx                              licences of the source files
#     DEVICES.md  RELEASE.md  SHA256SUMS                 known anomalies and tests of promises, release notes, checksums
#
# Needed in addition to the packages of `sh cmake/debian.sh build`: python3-wheel, python3-setuptools, reuse,
# gcc-aarch64-linux-gnu, libc6-dev-arm64-cross. Exit with 77 if a tool is missing. SUPINE_WORK names a folder that keeps the build for the next run.
set -eu
umask 022
export LC_ALL=C
cd "$(dirname "$0")/.."
fail() {
  echo "release.sh: $*" >&2
  exit 1
}
for tool in git cmake ninja cpack dpkg-shlibdeps help2man reuse aarch64-linux-gnu-gcc /usr/bin/python3; do
  command -v "$tool" >/dev/null || { echo "release.sh: $tool is not installed"; exit 77; }
done
/usr/bin/python3 -c 'import setuptools, wheel' 2>/dev/null || { echo "release.sh: no python3-setuptools and python3-wheel"; exit 77; }

header=runtime/include/supine/version.h
revision=${1:-v$(sed -n 's/^#define SUPINE_VERSION "\(.*\)"/\1/p' $header)}
commit=$(git rev-parse -q --verify "$revision^{commit}") || fail "$revision is not a commit: tag the release, or name a commit"
mkdir -p "$(dirname "${2:-build/dist}")"
mkdir "${2:-build/dist}" || fail "remove it, or name another folder"
out=$(cd "${2:-build/dist}" && pwd)
if [ -n "${SUPINE_WORK-}" ]; then
  mkdir -p "$SUPINE_WORK"
  work=$(cd "$SUPINE_WORK" && pwd)
else
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
fi
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct "$commit")
export SOURCE_DATE_EPOCH

# Extract the source, and check that its versions agree.
version=$(git show "$commit:$header" | sed -n 's/^#define SUPINE_VERSION "\(.*\)"/\1/p')
name=supine-$version
git archive --prefix="$name/" "$commit" | gzip -9n >"$out/$name.tar.gz"
rm -rf "$work/stage"
mkdir "$work/stage"
tar -xzf "$out/$name.tar.gz" -C "$work"
source=$work/$name
cd "$source"
number=$(echo "$version" | awk -F. '{ print 10000 * $1 + 100 * $2 + $3 }')
grep -q "^#define SUPINE_VERSION_NUMBER $number\b" $header || fail "$header: SUPINE_VERSION_NUMBER is not $number"
grep -qx "version: $version" CITATION.cff || fail "CITATION.cff: the version is not $version"
heading=$(grep -m 1 '^## ' CHANGELOG.md)
[ "${heading%%,*}" = "## [$version]" ] || fail "CHANGELOG.md: the first section is '$heading', not of $version"
date=$(sed -n 's/^date-released: *//p' CITATION.cff)
[ "$heading" != "## [$version], unreleased" ] || [ -z "$date" ] ||
  fail "CHANGELOG.md says unreleased, and CITATION.cff $date: write '## [$version], $date', or remove date-released"
case $revision in
v[0-9]*)
  [ "$revision" = "v$version" ] || fail "the tag $revision has version $version: the tag must be v$version"
  [ -n "$date" ] || fail "CITATION.cff has no date-released: add the date of the release"
  [ "$heading" = "## [$version], $date" ] ||
    fail "CHANGELOG.md has '$heading', and CITATION.cff the date $date: write '## [$version], $date'"
  ;;
*) echo "trial of $commit; a release needs the tag v$version" ;;
esac

# run COMMAND...: run a command quietly; print its output if it fails.
run() {
  "$@" >"$work/log" 2>&1 || { cat "$work/log" >&2; fail "failed: $*"; }
}
# pack FOLDER NAME FILE: write FOLDER/NAME to the archive FILE, with the date of the commit.
pack() {
  tar -C "$1" --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner --format=ustar -cf - "$2" |
    gzip -9n >"$3"
}

# Make the Debian package, and the npm package from the same build folder.
run cmake --preset package
run cmake --build --preset package
run cpack --config build/package/CPackConfig.cmake -B "$work/stage"
mv "$work"/stage/*.deb "$out"
run cmake --build build/package --target npm
pack build/package/runtime/js package "$out/$name.tgz"

# wheel LIBRARY PLATFORM: make the Python package with a run-time library.
wheel() {
  (cd runtime/python && rm -rf build && SUPINE_LIBRARY=$1 run /usr/bin/python3 setup.py -q bdist_wheel --plat-name "$2" -d "$out")
}
wheel "$source/build/package/runtime/libsupine_runtime.so" linux_x86_64
run cmake -B build/aarch64 -G Ninja -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 -DSUPINE_RUNTIME_ONLY=ON \
  -DCMAKE_C_COMPILER=aarch64-linux-gnu-gcc -DSUPINE_XXHASH_HEADER=/usr/include/xxhash.h -DBUILD_TESTING=OFF
run cmake --build build/aarch64
wheel "$source/build/aarch64/runtime/libsupine_runtime.so" linux_aarch64

# Make the relocatable archive. Link the program again, to search for libraries in ../lib: a RPATH, unlike a RUNPATH, also
# serves the libraries that libraries need. Add every library that is linked or loaded later, but not those of glibc.
rpath="-Wl,--disable-new-dtags,-rpath,'\$ORIGIN/../lib'"
run cmake --install build/package --prefix "$work/stage/all" --strip
run cmake --preset package -DCMAKE_EXE_LINKER_FLAGS="$rpath"
run cmake --build build/package --target supine
run cmake --preset package -DCMAKE_EXE_LINKER_FLAGS=
strip -o "$work/stage/all/bin/supine" build/package/supine
top=$work/stage/$name
mkdir -p "$top/bin" "$top/lib" "$top/share/doc/supine/libraries"
cp "$work/stage/all/bin/supine" "$top/bin"
(cd "$work/stage/all/share" && cp -r man bash-completion fish zsh "$top/share")
cp README.md CHANGELOG.md LICENSE LICENSES/* "$top/share/doc/supine"
strings "$top/bin/supine" | grep -x 'lib[a-z0-9_.-]*\.so\.[0-9a-z.]*' | sort -u | while read -r library; do
  ldconfig -p | awk -v name="$library" '$1 == name { print $NF; exit }'
done | xargs ldd "$top/bin/supine" | awk '$1 ~ /:$/ { print substr($1, 1, length($1) - 1) } $3 ~ /^\// { print $3 }' |
  grep '/lib[^/]*\.so' | grep -vE '/lib(c|m|dl|rt|pthread|resolv)\.so' | sort -u >"$work/stage/libraries"
while read -r library; do
  cp -L "$library" "$top/lib"
  file=$(readlink -f "$library") # packages name the file in /usr/lib or in /lib
  package=$({ dpkg -S "$file" || dpkg -S "${file#/usr}"; } 2>/dev/null | cut -d: -f1)
  cp "/usr/share/doc/$package/copyright" "$top/share/doc/supine/libraries/$package.copyright"
  dpkg-query -W -f '${source:Package} ${source:Version}\n' "$package" >>"$work/stage/sources"
  echo "${library##*/} $package" >>"$work/stage/packages"
done <"$work/stage/libraries"
sort -u "$work/stage/sources" >"$top/share/doc/supine/libraries/sources"
chmod -R u=rwX,go=rX "$top"
glibc=$(find "$top" -type f \( -path '*/bin/*' -o -path '*/lib/*' \) -exec objdump -T {} + | grep -o 'GLIBC_2\.[0-9]*' | sort -Vu | tail -1)
pack "$work/stage" "$name" "$out/$name-linux-x86_64-glibc${glibc#GLIBC_}.tar.gz"

# List the licences of the source files, with the time and the identity of the commit.
rm -rf "$work/stage/source"
mkdir "$work/stage/source"
tar -xzf "$out/$name.tar.gz" -C "$work/stage/source"
(cd "$work/stage/source/$name" && reuse spdx 2>/dev/null) |
  sed "s|^DocumentNamespace: .*|DocumentNamespace: http://spdx.org/spdxdocs/$name-$commit|
    s|^Created: .*|Created: $(date -u -d "@$SOURCE_DATE_EPOCH" +%Y-%m-%dT%H:%M:%SZ)|" >"$out/$name.spdx"
/usr/bin/python3 packaging/sbom.py "$out" "$version" "$commit" "$top" "$work/stage/packages"
/usr/bin/python3 docs/devices.py . >"$out/DEVICES.md"
awk '/^## / { ++section } section == 1' CHANGELOG.md >"$out/RELEASE.md"

# Check that what was built states the version.
for file in "$name.tar.gz" "supine_${version}_amd64.deb" "$name-linux-x86_64-glibc*.tar.gz" "$name-py3-none-manylinux_*_x86_64.whl" \
  "$name-py3-none-manylinux_*_aarch64.whl" "$name.tgz"; do
  [ -f "$(find "$out" -name "$file")" ] || fail "$file was not made: $(ls "$out")"
done
"$top/bin/supine" --version | grep -qwF "$version" || fail "the program states $("$top/bin/supine" --version)"
grep -qF "\"version\": \"$version\"" build/package/runtime/js/package/package.json || fail "the npm package is not of $version"
(cd "$out" && find . -type f ! -name SHA256SUMS -printf '%P\n' | sort | xargs sha256sum >SHA256SUMS)
cat "$out/SHA256SUMS"
