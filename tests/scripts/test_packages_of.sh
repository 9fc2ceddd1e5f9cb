#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# The Debian package depends on the packages of the libraries that the program loads at their first use, by the names that
# they have on this system: test_packages_of.sh CMAKE SOURCE_FOLDER BUILD_FOLDER
set -eu
cmake=$1 source=$2 build=$3
fail() {
  echo "$*" >&2
  exit 1
}
command -v dpkg-query >/dev/null || { echo "skipped: no dpkg-query"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Another system, where packages have other names, a file has two owners, and packages still have files in /lib.
mkdir "$work/bin" "$work/developer"
cat >"$work/bin/dpkg-query" <<'END'
#!/bin/sh
case $2 in
*/libcairo.so.9.1) echo "libcairo9t64:amd64: $2" ;;
*/libboth.so.1) echo "libboth1:amd64, libboth1:i386: $2" ;;
*) echo "dpkg-query: no path found matching pattern $2" >&2; exit 1 ;;
esac
END
chmod +x "$work/bin/dpkg-query"
: >"$work/libcairo.so.9.1"
: >"$work/libboth.so.1"
: >"$work/libnone.so.1"
ln -s ../libcairo.so.9.1 "$work/developer/libcairo.so"
got=$(PATH=$work/bin:$PATH "$cmake" \
  "-DFILES=$work/libnone.so.1;$work/developer/libcairo.so;$work/libboth.so.1;$work/libcairo.so.9.1" \
  -P "$source/packaging/packages_of.cmake" 2>&1 | tail -1)
[ "$got" = "libboth1, libcairo9t64" ] || fail "found '$got'"

# This system: what the program names is in the package's dependencies.
depends=$(sed -n 's/^set(CPACK_DEBIAN_PACKAGE_DEPENDS "\(.*\)")$/\1/p' "$build/CPackConfig.cmake")
readelf --dynamic --wide "$build/supine" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' >"$work/linked"
names=$(strings "$build/supine" | grep -E '^lib[A-Za-z0-9_-]+\.so\.[0-9.]+[a-z]?$' | sort -u | grep -Fxvf "$work/linked")
[ -n "$names" ] || fail "the program names no library"
for name in $names; do
  file=$(/sbin/ldconfig -p | awk -v name="$name" '$1 == name { print $NF; exit }')
  [ -n "$file" ] || fail "$name is not installed"
  file=$(readlink -f "$file")
  package=$(dpkg-query --search "$file" 2>/dev/null || dpkg-query --search "${file#/usr}")
  package=${package%%:*}
  case ", $depends, " in
  *", $package, "*) echo "$name: $package" ;;
  *) fail "$name: the package does not depend on $package: $depends" ;;
  esac
done
