#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Check that no command loses data: test_no_data_lost.sh PROGRAM [KILLS [SIGNALS]]
#
# An output that is also an input is refused, even if it is named by a link. A missing folder is reported before the
# inputs are read. A full disk, a size limit or a signal leaves no incomplete file under the name of the output, and none
# under another name, except for KILL. Each command that writes a file is ended by each of the SIGNALS (default KILL TERM
# INT) at KILLS random moments (default 1).
set -u
export SOURCE_DATE_EPOCH=0 # so that a report made again is the same, even after midnight
supine=$1
kills=${2:-1}
signals=${3:-KILL TERM INT}
work=$(mktemp -d) || exit 1
trap 'exit 1' INT TERM
trap 'cd /; umount "$work/small" 2>/dev/null; rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

"$supine" phantom --vertices 700 -o lungs.ply >/dev/null || exit 1
"$supine" precompute lungs.ply --band 3 -o lungs.safetensors >/dev/null || exit 1
"$supine" pv show | cut -d, -f1,2 | sed '1s/.*/pressure_cmH2O,volume_mL/' >samples.csv
"$supine" pv fit samples.csv -o lungs.pv >/dev/null || exit 1
awk 'BEGIN { print "name,x,y,z"; for (i = 0; i < 300; ++i) printf "p%d,%d,%d,%d\n", i, 60 + i % 50, -100 - i % 40, -100 - i % 60 }' >points.csv
"$supine" embed lungs.safetensors points.csv -o points.safetensors >/dev/null 2>&1 || exit 1

# refused INPUT ENDING COMMAND...: copy INPUT to "input" with this ending. Run the command with the copy as its output,
# named by its path, a hard link or a symbolic link. Check that the command refuses, and that the copy is unchanged.
refused() {
  input=$1
  ending=$2
  shift 2
  cp "$input" "before$ending" && cp "$input" "input$ending"
  ln -f "input$ending" "hard$ending"
  ln -sf "input$ending" "soft$ending"
  for name in "input$ending" "./input$ending" "hard$ending" "soft$ending" "$work/input$ending"; do
    "$supine" "$@" -o "$name" >log 2>&1
    code=$?
    [ $code -eq 1 ] && grep -q 'is also an input' log || fail "$* -o $name: $code, $(cat log)"
    cmp -s "before$ending" "input$ending" || fail "$* -o $name: the input has changed"
  done
  rm -f "before$ending" "input$ending" "hard$ending" "soft$ending"
}
# The input gets the ending of the output, so that the command has no other reason to refuse the output.
refused lungs.ply .ply precompute input.ply
refused lungs.ply .ply solve input.ply --posture prone
refused lungs.safetensors .safetensors precompute lungs.ply --fields input.safetensors
refused lungs.safetensors .ply deform input.ply --posture prone
refused lungs.safetensors .html compare input.html
refused lungs.safetensors .png render input.png --posture prone
refused lungs.safetensors .html export input.html
refused lungs.safetensors .glb export input.glb
refused lungs.safetensors .vtp breathe input.vtp --posture prone
refused lungs.pv .vtp breathe lungs.safetensors --posture prone --pv input.vtp
refused samples.csv .csv pv fit input.csv
refused points.csv .safetensors embed lungs.safetensors input.safetensors
refused points.csv .json fit --landmarks input.json
refused lungs.ply .png validate lungs.safetensors --state prone:input.png
"$supine" precompute lungs.ply -o basis.stl >log 2>&1
[ $? -eq 1 ] && [ ! -e basis.stl ] || fail "precompute -o basis.stl is not refused: $(cat log)"

# A missing output folder is reported before the input is read.
"$supine" precompute missing.ply -o nowhere/a.safetensors >log 2>&1
[ $? -eq 4 ] && grep -q 'nowhere/a.safetensors: .*No such file' log || fail "precompute into a missing folder: $(cat log)"

# A link is kept, and its target is replaced.
mkdir far
echo old >far/target.ply
ln -s far/target.ply link.ply
"$supine" deform lungs.safetensors --posture prone -o link.ply >/dev/null || fail "deform -o link.ply"
[ -L link.ply ] && [ "$(head -c 3 far/target.ply)" = ply ] || fail "the link was replaced"

# writer NAME COMMAND...: run "COMMAND -o NAME" once to its end, then with a size limit, a full disk and signals.
writer() {
  name=$1
  shift
  mkdir out
  began=$(date +%s%N)
  "$supine" "$@" -o "out/$name" >log 2>&1
  code=$?
  took=$((($(date +%s%N) - began) / 1000000))
  if [ $code -eq 3 ]; then
    echo "skipped $1: $(cat log)"
    rm -rf out
    return
  fi
  [ $code -eq 0 ] || fail "$*: $code, $(cat log)"
  mv "out/$name" whole
  rm -rf out && mkdir out

  (ulimit -f 8; "$supine" "$@" -o "out/$name" >log 2>&1)
  code=$?
  [ $code -eq 4 ] && grep -q 'File too large' log || fail "$*: too large: $code, $(cat log)"
  [ -z "$(ls -A out)" ] || fail "$*: too large left $(ls -A out)"

  if [ -d small ]; then
    "$supine" "$@" -o "small/$name" >log 2>&1
    code=$?
    [ $code -eq 4 ] && grep -q 'No space left on device' log || fail "$*: full: $code, $(cat log)"
    [ "$(ls -A small)" = filler ] || fail "$*: a full disk left $(ls -A small)"
  fi

  for signal in $signals; do
    done_whole=0
    for i in $(seq "$kills"); do
      moment=$(awk -v seed="$i$took" -v took="$took" 'BEGIN { srand(seed); for (k = 0; k < 9; ++k) rand(); printf "%.4f", rand() * took / 1000 }')
      timeout -s $signal "$moment" "$supine" "$@" -o "out/$name" >/dev/null 2>&1
      [ $signal = KILL ] && rm -f "out/$name".part-*
      case "$(ls -A out)" in
      "") ;;
      "$name")
        done_whole=$((done_whole + 1))
        cmp -s whole "out/$name" || fail "$*: SIG$signal at $moment s left an incomplete file"
        ;;
      *) fail "$*: SIG$signal at $moment s left $(ls -A out)" ;;
      esac
      rm -rf out && mkdir out
    done
    echo "$1: $kills times SIG$signal within $took ms: $done_whole left a complete file, the others none"
  done
  rm -rf out whole
}
mkdir small
if mount -t tmpfs -o size=16k tmpfs small 2>/dev/null; then
  head -c 8192 /dev/zero >small/filler
else
  rmdir small
  echo "full disk not tested: only root can mount one"
fi
writer phantom.ply phantom --vertices 20000
writer basis.safetensors precompute lungs.ply --band 3
writer prone.vtp deform lungs.safetensors --posture prone
writer prone.stl solve lungs.ply --posture prone
writer column.csv solve lungs.ply --unit-force 3
writer report.html compare lungs.safetensors --postures supine,prone
writer lung.png render lungs.safetensors --posture supine
writer page.html export lungs.safetensors
writer lungs.glb export lungs.safetensors --animate
writer frames.safetensors breathe lungs.safetensors --posture prone
writer frames.vtp breathe lungs.safetensors --posture prone
writer turn.webp render lungs.safetensors --turn supine:left:0.1s
writer inside.safetensors embed lungs.safetensors lungs.ply
writer moved.csv deform points.safetensors --posture prone
writer errors.png validate lungs.safetensors --state prone:lungs.ply

[ $failures -eq 0 ] || { echo "$failures failures"; exit 1; }
