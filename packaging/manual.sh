#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Make the manual page of every command from its --help-all: manual.sh PROGRAM FOLDER VERSION. Needs help2man.
set -eu
mkdir -p "$2"
out=$(cd "$2" && pwd)
cd "$(dirname "$1")"
program=./$(basename "$1")

# page COMMAND SUMMARY VERSION: make the page of a command, or of the program if COMMAND is empty.
page() {
  name=supine${1:+-$1}
  help2man --no-info --name="$2" --version-string="$3" --no-discard-stderr --help-option="${1:+$1 }--help${1:+-all}" \
    --section=1 --manual='User Commands' --source="supine $3" "$program" |
    sed "s/^\.TH SUPINE /.TH $(echo "$name" | tr '[:lower:]' '[:upper:]') /
      /^\.SH NAME/{n;s/^supine /$name /;}" >"$out/$name.1"
  gzip -9nkf "$out/$name.1"
}
page "" "lungs that deform with gravity, in real time" "$3"
"$program" --help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) */\1 /p' | while read -r command summary; do
  page "$command" "$summary" "$3"
done
