#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Compare the whole output of commands with golden files: test_command_output.sh PROGRAM FOLDER
#
# Each golden file FOLDER/*.txt is a session: lines "$ COMMAND", each followed by what the command prints on
# stdout and stderr, and by the exit code if it is not 0. Sessions run in a folder with lungs.ply, synthetic
# lungs of about 500 vertices, and lungs.safetensors, the basis of these lungs. Numbers that depend on the
# processor are rounded by the filter `rounded`; same_output.py then accepts a difference of one in the
# last digit. sed replaces times and residuals. To replace the golden files by the current output:
#
#   SUPINE_GOLDEN_UPDATE=1 ctest --preset release -R command_output
set -u
program=$1
golden=$2
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
mkdir "$work/bin"
ln -s "$program" "$work/bin/supine"
cat >"$work/bin/rounded" <<'END'
#!/bin/sh
# rounded [DIGITS [LEAST]] [FILE]: round decimal numbers to DIGITS significant digits (default 4), and numbers below
# LEAST (default 1e-7) to 0. A session gives LEAST if its numbers are small differences of large ones.
digits=4
least=1e-7
case ${1-} in [1-9]) digits=$1; shift ;; esac
case ${1-} in 0.*) least=$1; shift ;; esac
exec awk -v digits="$digits" -v least="$least" '{
  line = $0
  out = ""
  while (match(line, /-?[0-9]+(\.[0-9]+(e[-+]?[0-9]+)?|e[-+]?[0-9]+)/)) {
    number = substr(line, RSTART, RLENGTH) + 0
    out = out substr(line, 1, RSTART - 1) sprintf("%.*g", digits, number * number < least * least ? 0 : number)
    line = substr(line, RSTART + RLENGTH)
  }
  print out line
}' "$@"
END
chmod +x "$work/bin/rounded"
PATH="$work/bin:$PATH"
mkdir "$work/here"
cd "$work/here" || exit 1
supine phantom --vertices 500 -o lungs.ply >/dev/null || exit 1
supine precompute lungs.ply --band 3 -o lungs.safetensors >/dev/null || exit 1

failed=0
for session in "$golden"/*.txt; do
  grep '^\$ ' "$session" | while IFS= read -r line; do
    printf '%s\n' "$line"
    sh -c "${line#\$ }" 2>&1 </dev/null
    code=$?
    [ $code -eq 0 ] || echo "exit code $code"
  done >"$work/now.txt"
  if [ -n "${SUPINE_GOLDEN_UPDATE-}" ]; then
    cmp -s "$work/now.txt" "$session" || { cp "$work/now.txt" "$session" && echo "updated $session"; }
  elif ! python3 "$(dirname "$0")/same_output.py" "$session" "$work/now.txt"; then
    failed=1
  fi
done
exit $failed
