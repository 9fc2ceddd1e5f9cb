#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Test a package in a clean Debian 12, as root: try_package.sh supine_*.deb examples/deform/deform.c
# Install the package by apt, run the program, compile the example with the library, purge the package, and check
# that no file is left.
set -eu
package=$1
example=$2
root=$(mktemp -d)
trap 'umount "$root/proc" 2>/dev/null || true; rm -rf "$root"' EXIT
debootstrap --variant=minbase bookworm "$root" >/dev/null
mount -t proc proc "$root/proc"
cp "$package" "$root/srv/supine.deb"
cp "$example" "$root/srv/example.c"
inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive sh -ec "$1"; }
inside 'apt-get update -qq; apt-get install -y -qq --no-install-recommends gcc libc6-dev pkg-config python3-numpy >/dev/null 2>&1'
inside 'find / -xdev -name "*supine*" ! -path "/srv/*" ! -path "/proc/*"' >"$root/before"
inside 'apt-get install -y -qq --no-install-recommends /srv/supine.deb >/dev/null 2>&1'
inside 'cd /srv; supine phantom --vertices 2000 -o lungs.ply; supine precompute lungs.ply --band 3 -o lungs.safetensors
  supine deform lungs.safetensors --posture prone -o prone.vtp
  gcc -o example example.c $(pkg-config --cflags --libs supine-runtime) && ./example lungs.safetensors prone:rest+500
  gcc -o static example.c -l:libsupine_runtime.a -lm && ./static lungs.safetensors prone:rest+500
  python3 -c "import supine; lungs = supine.open(\"lungs.safetensors\"); print(lungs.deform(lungs.pose(\"prone\"))[0])"
  man -w supine-deform 2>/dev/null || ls /usr/share/man/man1/supine-deform.1.gz /usr/share/bash-completion/completions/supine'
inside 'apt-get purge -y -qq supine >/dev/null 2>&1'
inside 'find / -xdev -name "*supine*" ! -path "/srv/*" ! -path "/proc/*" ! -path "/var/log/*"' >"$root/after"
cmp "$root/before" "$root/after"
echo "installed, run, compiled against and purged: no file is left"
