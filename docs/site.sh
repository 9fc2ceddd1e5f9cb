#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Make the site of the guide and the C reference: site.sh DOXYFILE SOURCE_FOLDER OUTPUT_FOLDER
# doxygen does not resolve links between pages in a folder whose name has spaces, so it runs in a link to the folder.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
ln -s "$2" "$work/source"
ln -s "$3" "$work/output"
rm -rf "$3/site"
sed "s|SITE_SOURCE|$work/source|g; s|SITE_OUTPUT|$work/output|g" "$1" >"$work/Doxyfile"
cd "$work/source"
doxygen "$work/Doxyfile"
echo "open $3/site/index.html"
