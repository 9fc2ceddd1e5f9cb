#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Check manual pages and completions, made from the tables of options: test_manual.sh PROGRAM FOLDER
# Shells that are not installed are left out.
set -u
supine=$1
tests=$(cd "$(dirname "$0")" && pwd)
cd "$2" || exit 1
manual=$PWD
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

commands=$("$supine" --help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')
[ "$(echo "$commands" | wc -w)" -ge 11 ] || fail "commands: $commands"

# Every option of --help-all is in the manual page of its command and in the completions.
for command in $commands; do
  options=$("$supine" "$command" --help-all | grep -oE '^  (-[a-z], )?--[a-z-]+' | grep -oE -- '--.*' | sort -u)
  [ -n "$options" ] || fail "$command has no options"
  # holds FILE: report the options that are not in the list on standard input.
  holds() {
    lacks=$(comm -23 <(echo "$options") <(sort -u))
    [ -z "$lacks" ] || fail "$1: $command lacks" $lacks
  }
  holds "supine-$command.1" < <(sed 's/\\-/-/g' "supine-$command.1" | grep -oE -- '--[a-z-]+')
  holds supine.bash < <(grep "^  $command) words=" supine.bash | grep -oE -- '--[a-z-]+')
  holds _supine < <(sed -n "/^$command)/,/;;/s/.*\(--[a-z-]*\)}\{0,1\}'\[.*/\1/p" _supine)
  holds supine.fish < <(sed -n "s/.*command $command' -l \([a-z-]*\) .*/--\1/p" supine.fish)
  if command -v groff >/dev/null; then
    warnings=$(groff -man -Tutf8 -ww -z "supine-$command.1" 2>&1)
    [ -z "$warnings" ] || fail "supine-$command.1: $warnings"
  fi
done

# Completions of the last word of a line.
lines="supine def
supine deform lungs.safetensors --pos
supine deform lungs.safetensors --posture pr
supine precompute --law p
supine precompute lu
supine precompute -o lu
supine precompute --fields lu
supine info --help-"
wanted="deform
--posture
prone
paper
lungs.ply
lungs.ply
lungs.ply
--help-all"
complete_bash() {
  . "$manual/supine.bash"
  while read -ra COMP_WORDS; do
    COMP_CWORD=$((${#COMP_WORDS[@]} - 1)) COMPREPLY=()
    _supine
    echo "${COMPREPLY[*]}"
  done
}
complete_zsh() {
  zsh -f "$tests/complete.zsh" "$manual"
}
complete_fish() {
  fish --no-config -c 'source $argv; while read line; complete -C $line | cut -f 1 | string join " "; end' "$manual/supine.fish"
}
cd "$(mktemp -d)" && : >lungs.ply
for shell in bash zsh fish; do
  command -v $shell >/dev/null || continue
  got=$(echo "$lines" | complete_$shell)
  [ "$got" = "$wanted" ] || fail "$shell completes" $got
  got=$([ $shell = zsh ] || echo "supine precompute --band 3" | complete_$shell)
  [ -z "$got" ] || fail "$shell completes a number: $got"
done
rm -r "$PWD"
cd "$manual" || exit 1
[ $failures -eq 0 ] || exit 1
