#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Check manual pages and completions, made from the tables of options: test_manual.sh PROGRAM FOLDER
set -u
supine=$1
cd "$2" || exit 1
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

commands=$("$supine" --help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')
[ "$(echo "$commands" | wc -w)" -ge 11 ] || fail "commands: $commands"

# Every option of --help-all is in the manual page of its command and in the completion.
for command in $commands; do
  for option in $("$supine" "$command" --help-all | grep -oE '^  (-[a-z], )?--[a-z-]+' | grep -oE -- '--.*'); do
    sed 's/\\-/-/g' "supine-$command.1" | grep -q -- "$option" || fail "supine-$command.1 lacks $option"
    grep "^  $command) words=" supine.bash | grep -q -- "$option " || fail "supine.bash: $command lacks $option"
  done
  if command -v groff >/dev/null; then
    warnings=$(groff -man -Tutf8 -ww -z "supine-$command.1" 2>&1)
    [ -z "$warnings" ] || fail "supine-$command.1: $warnings"
  fi
done

. ./supine.bash
# complete_words WORDS...: print bash's completions of the last word.
complete_words() {
  COMP_WORDS=(supine "$@")
  COMP_CWORD=$#
  COMPREPLY=()
  _supine
  echo "${COMPREPLY[*]}"
}
expect() {
  wanted=$1
  shift
  got=$(complete_words "$@")
  [ "$got" = "$wanted" ] || fail "$*: '$got', not '$wanted'"
}
expect "deform" def
expect "--posture" deform lungs.safetensors --pos
expect "prone" deform lungs.safetensors --posture pr
expect "paper" precompute --law p
expect "" precompute --band 3
cd "$(mktemp -d)" && : >lungs.ply
expect "lungs.ply" precompute lu
expect "lungs.ply" precompute -o lu
expect "lungs.ply" precompute --fields lu
rm -r "$PWD"
cd "$2" || exit 1
[ $failures -eq 0 ] || exit 1
