#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Commit a copy of the sources to a new repository, and release it twice: test_release.sh SOURCE_FOLDER
#
# Check that wrong versions and dates are refused, that both releases have the same bytes, that the program of the archive
# runs with its own libraries alone, that the wheels hold libraries of their processors, and that abi.sh finds a change of
# the interface. Exit with 77 if a tool is missing.
set -eu
fail() {
  echo "FAILED: $*"
  exit 1
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/repository" "$work/a place"
cd "$1"
modules=$PWD/tests/export/node_modules
tar -c --exclude=./build --exclude=./.git --exclude=./demo --exclude=node_modules . | tar -x -C "$work/repository"
cd "$work/repository"
export GIT_CONFIG_GLOBAL=/dev/null GIT_COMMITTER_DATE=2026-01-02T03:04:05Z GIT_AUTHOR_DATE=2026-01-02T03:04:05Z
commit() {
  git add -A
  git -c user.name=test -c user.email=test@example.org -c commit.gpgsign=false commit -qm "$1"
}
version=$(sed -n 's/^#define SUPINE_VERSION "\(.*\)"/\1/p' runtime/include/supine/version.h)
git init -q
sed -i "s/^## \[$version\].*/## [$version], unreleased/" CHANGELOG.md
commit undated
git tag v9.9.9
git tag "v$version"
refuse() {
  message=$1
  shift
  sh packaging/release.sh "$@" "$work/refused" >"$work/log" 2>&1 && fail "accepted: $message"
  grep -q "^release.sh: .* is not installed\|no python3" "$work/log" && { cat "$work/log"; exit 77; }
  grep -q -- "$message" "$work/log" || { cat "$work/log"; fail "no message '$message'"; }
  rm -rf "$work/refused"
}
refuse 'v9.9.9 has version' v9.9.9
refuse 'CITATION.cff has no date-released' "v$version"
refuse 'v8.8.8 is not a commit' v8.8.8
cp CITATION.cff "$work"
sed -i 's/^version: .*/version: 8.8.8/' CITATION.cff
commit other
refuse 'CITATION.cff: the version is not' HEAD
cp "$work/CITATION.cff" .
sed -i "s/^version: .*/&\ndate-released: 2026-11-23/" CITATION.cff
commit cited
refuse "write '## \[$version\], 20" HEAD
sed -i "s/^## \[$version\].*/## [$version], 2026-11-23/" CHANGELOG.md
commit dated
git tag -f "v$version" >/dev/null

export SUPINE_WORK="$work/a build"
sh packaging/release.sh "v$version" "$work/one" >"$work/log" 2>&1 || { cat "$work/log"; fail "the release"; }
(umask 077 && TZ=Asia/Tokyo sh packaging/release.sh >"$work/log" 2>&1) || { cat "$work/log"; fail "the second release"; }
diff "$work/one/SHA256SUMS" build/dist/SHA256SUMS || fail "the second release differs"
cd "$work/one"
sha256sum --quiet -c SHA256SUMS
[ "$(wc -l <SHA256SUMS)" = 11 ] || fail "files: $(ls)"
tar -tzf "supine-$version.tar.gz" | grep -q /base/text.c || fail "no source"
grep -q '^FileName: ./base/text.c' "supine-$version.spdx" && grep -q '^## ' RELEASE.md || fail "SBOM or notes"
grep -q '^## Known anomalies' DEVICES.md || fail "no known anomalies"
grep -q "\[$version\]" RELEASE.md && ! grep -q '^## \[0.1.0\]' RELEASE.md || fail "notes of other versions"

# The program, moved to another folder, loads only libraries of the archive and of glibc.
cd "$work/a place"
tar -xzf "$work"/one/*-linux-x86_64-glibc*.tar.gz
mv "supine-$version" "moved again"
/usr/bin/python3 "$work/repository/tests/scripts/test_sbom.py" "$work/one" "moved again" "$modules" || fail "SBOM of the binaries"
run() {
  env -i LD_DEBUG=libs "moved again/bin/supine" "$@" >log 2>&1 || { grep -v '^ *[0-9]*:' log; fail "supine $*"; }
  sed -n 's/.*calling init: //p' log >>loaded
}
run phantom --vertices 500 -o lungs.ply
run precompute lungs.ply --band 3 --held-out 20 -o lungs.safetensors
run export lungs.safetensors -o lungs.html
run render lungs.safetensors --posture prone -o lungs.png
grep -vF "/moved again/bin/../lib/" loaded | grep -vE '/(ld-linux-x86-64|lib(c|m|dl|rt|pthread|resolv))\.so' && fail "loaded from elsewhere"
for name in cholmod cairo meshoptimizer openblas; do
  grep -qF "/moved again/bin/../lib/lib$name" loaded || fail "lib$name was not loaded"
done
for processor in x86_64:X86-64 aarch64:AArch64; do
  rm -rf wheel
  /usr/bin/python3 -m zipfile -e "$work"/one/*_"${processor%:*}".whl wheel
  readelf -h wheel/supine/libsupine_runtime.so | grep -q "Machine:.*${processor#*:}" || fail "wheel of $processor"
  [ "${processor%:*}" = aarch64 ] || PYTHONPATH=wheel /usr/bin/python3 -c 'import supine
lungs = supine.open("lungs.safetensors")
assert lungs.deform(lungs.pose("prone")).shape == lungs.vertices.shape' || fail "the wheel"
done

# abi.sh compares with the tag of this version, and finds a struct that has grown.
cd "$work/repository"
sh tests/abi.sh >"$work/log" || { status=$?; cat "$work/log"; exit $status; }
sed -i 's/^  double gains\[SUPINE_LUNGS_MAX\]\[3\];/&\n  double other;/' runtime/include/supine/runtime.h
commit grown
sh tests/abi.sh >"$work/log" && fail "abi.sh finds no change"
grep -q supine_pose "$work/log" || { cat "$work/log"; fail "abi.sh"; }
echo "released twice with the same bytes, run, and its interface compared"
