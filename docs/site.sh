#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Make the site of the guide, the C reference and the live page:
#   site.sh DOXYFILE SOURCE_FOLDER OUTPUT_FOLDER PROGRAM PYTHON
# doxygen does not resolve links between pages in a folder whose name has spaces, so it runs in a link to the folder.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
ln -s "$2" "$work/source"
ln -s "$3" "$work/output"
rm -rf "$3/site"
mkdir -p "$3/site"
sed "s|SITE_SOURCE|$work/source|g; s|SITE_OUTPUT|$work/output|g" "$1" >"$work/Doxyfile"
(cd "$work/source" && doxygen "$work/Doxyfile")
sh "$2/cmake/demo.sh" "$4" "$3/demo" >"$3/demo.txt"
"$5" "$2/docs/site.py" "$2" "$3/demo" "$3/site"
