#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# The documentation as a small site: site.sh PROGRAM FOLDER
#
# README, the library's headers by Doxygen, the manual of every command, the figures, and pictures,
# a report and a page that the program makes. Begin at FOLDER/html/index.html. Ends with 1 where
# Doxygen has anything to say.
set -eu
supine=$1
mkdir -p "$2/made"
out=$(cd "$2" && pwd)
cd "$(dirname "$0")/.."

"$supine" phantom --vertices 20000 -o "$out/made/lungs.ply" >/dev/null
"$supine" precompute "$out/made/lungs.ply" -o "$out/made/lungs.safetensors" >/dev/null
"$supine" render "$out/made/lungs.safetensors" --posture left,right --view anterior,head -o "$out/made/sides.png" >/dev/null
"$supine" render "$out/made/lungs.safetensors" --posture prone --view anterior,left,oblique \
  --colour difference:supine -o "$out/made/difference.png" >/dev/null
"$supine" compare "$out/made/lungs.safetensors" --postures supine,prone,left,right -o "$out/made/report.html" >/dev/null
"$supine" export "$out/made/lungs.safetensors" -o "$out/made/page.html" >/dev/null

{
  echo '# Commands {#commands}'
  echo 'What `supine COMMAND --help` and the manual pages say. Of made lungs, these commands made'
  echo '<a href="page.html">a page to turn them in</a> and <a href="report.html">a report</a>.'
  for command in $("$supine" --help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p'); do
    printf '\n## supine %s\n```{.unparsed}\n' "$command"
    "$supine" "$command" --help-all
    echo '```'
    case $command in
    render) printf '![on the left and on the right, from before and from above](sides.png)\n' ;;
    compare) printf '![prone, coloured by what differs from supine](difference.png)\n' ;;
    esac
  done
} >"$out/commands.md"

echo 'img { max-width: 100%; height: auto; }' >"$out/site.css"
doxygen - <<END
PROJECT_NAME = Supine
PROJECT_NUMBER = $("$supine" --version | sed 's/[^0-9]*\([0-9.]*\).*/\1/')
PROJECT_BRIEF = "lungs that deform with gravity, in real time"
OUTPUT_DIRECTORY = $out
INPUT = README.md $out/commands.md tests/FIGURES.md runtime/BINDINGS.md CHANGELOG.md SECURITY.md \\
  runtime/include/supine
USE_MDFILE_AS_MAINPAGE = README.md
FILE_PATTERNS = *.h *.md
IMAGE_PATH = . program/render $out/made
EXAMPLE_PATH = tests/example
HTML_EXTRA_FILES = $out/made/page.html $out/made/report.html
STRIP_FROM_INC_PATH = runtime/include
EXTRACT_ALL = YES
OPTIMIZE_OUTPUT_FOR_C = YES
JAVADOC_AUTOBRIEF = YES
TYPEDEF_HIDES_STRUCT = YES
HAVE_DOT = NO
CLASS_GRAPH = NO
MACRO_EXPANSION = YES
EXPAND_ONLY_PREDEF = YES
PREDEFINED = SUPINE_API=
GENERATE_LATEX = NO
HTML_EXTRA_STYLESHEET = $out/site.css
HTML_TIMESTAMP = NO
QUIET = YES
WARN_IF_INCOMPLETE_DOC = NO
WARN_LOGFILE = $out/warnings
END
[ ! -s "$out/warnings" ] || { cat "$out/warnings"; exit 1; }
echo "$out/html/index.html"
