#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# From a law to a patient's basis and back: test_patient_command.sh PROGRAM
#
# Lungs are moved by a known law; fit finds it from the surfaces, precompute makes a basis of it, and
# validate finds what fit said was left; and the same from landmarks. Then what is refused.
set -u
supine=$1
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
fail() {
  echo "FAILED: $*"
  exit 1
}
number() { # KEY FILE [N]: the Nth number of that key
  sed -n "s/^ *\"$1\": \(-*[0-9.e+-]*\),*\$/\1/p" "$2" | sed -n "${3:-1}p"
}
near() { # A B TOLERANCE
  awk -v a="$1" -v b="$2" -v t="$3" 'BEGIN { exit !(a != "" && b != "" && a - b < t && b - a < t) }'
}

"$supine" phantom -o rest.ply --vertices 400 >/dev/null || fail phantom
"$supine" solve rest.ply --posture supine --reach 10 --base 0.9 --gain 0.4 --box-force 0,-0.2,0 \
  --constants 5,2.2,9,1.1,20,1.4 --scale 30 -o state.ply >/dev/null || fail solve

# Surfaces: the law comes back, and its basis lies on the state.
"$supine" fit rest.ply state.ply --name "somebody" -o surface.json --json >fit.json || fail fit
"$supine" precompute rest.ply --patient surface.json --reach 10 -o surface.safetensors >/dev/null ||
  fail precompute
"$supine" info surface.safetensors | grep -q 'patient *somebody: paper law .* held out' ||
  fail "info does not say whose"
"$supine" validate surface.safetensors --state state.ply --json >valid.json || fail validate
near "$(number rms_mm valid.json)" 0 0.1 || fail "surfaces $(number rms_mm valid.json) mm apart"
near "$(number explained_percent valid.json)" 100 0.1 || fail "not explained"
awk -v a="$(number rms_mm valid.json)" -v b="$(number rms_mm valid.json 5)" \
  'BEGIN { exit !(a < b / 3) }' || fail "no better than an affine map"
"$supine" deform surface.safetensors --posture left --volume scan+300 -o left.ply >/dev/null ||
  fail "no other posture"

# A stiff part comes back, goes into the basis, and the basis lies on the state.
"$supine" solve rest.ply --posture supine --reach 10 --base 0.9 --gain 0.4 --box-force 0,-0.2,0 \
  --constants 5,2.2,9,1.1,20,1.4 --scale 30 --lesion 97,-135,-190,65,3 -o stiff.ply >/dev/null ||
  fail "solve with a lesion"
"$supine" fit rest.ply stiff.ply --expandability -o stiff.json >fit.txt || fail "fit a lesion"
grep -q 'kept; nine tenths of what is seen' fit.txt || fail "no expandability kept"
grep -q 'least expandable: left lung' fit.txt || fail "not told: $(cat fit.txt)"
grep -q 'not seen: [1-9][0-9]* of [0-9]* regions' fit.txt || fail "all is seen: $(cat fit.txt)"
grep -q 'correlation with height along gravity \(0.99\|1.00\);.* leaves [0-3] %' fit.txt || # what was made
  fail "the force: $(grep correlation fit.txt)"
"$supine" precompute rest.ply --patient stiff.json --reach 10 -o stiff.safetensors >/dev/null ||
  fail "precompute with stiffness"
"$supine" validate stiff.safetensors --state stiff.ply --json >valid.json || fail "validate stiff"
near "$(number explained_percent valid.json)" 100 2 || # regions are not of the lesion's shape
  fail "stiff: $(number explained_percent valid.json) % explained"

# Several states, from one that is not the basis's surface: what a basis moved, it predicts; scales
# are all but linear in volume; and there is a picture of nothing much.
"$supine" precompute rest.ply --band 3 -o full.safetensors >/dev/null || fail "precompute"
"$supine" deform full.safetensors --posture supine --volume rest -o scan.ply >/dev/null ||
  fail "deform to rest"
"$supine" precompute scan.ply --scanned supine:rest --law deep --band 3 -o scanned.safetensors \
  >/dev/null || fail "precompute a scan at rest"
"$supine" validate scanned.safetensors --state supine:-0:scan.ply --json >valid.json ||
  fail "validate the scan itself"
near "$(number rms_mm valid.json 2)" 0 0.01 || fail "motion does not start from the scan"
near "$(number rms_mm valid.json)" 0 0.01 || fail "the scan is not predicted"
for volume in rest+400 rest+900 rest+1500; do
  "$supine" deform scanned.safetensors --posture supine --volume $volume -o $volume.ply >/dev/null ||
    fail "deform to $volume"
done
"$supine" deform scanned.safetensors --posture prone --volume rest -o prone.ply >/dev/null ||
  fail "deform prone"
"$supine" validate scanned.safetensors --state supine:rest+400.ply --state supine:rest+900.ply \
  --state supine:rest+1500:rest+1500.ply --state prone:rest:prone.ply --from supine:rest -o errors.png --json >valid.json
code=$?
[ $code -eq 0 ] || [ $code -eq 3 ] || fail "validate several: $code" # 3: nothing here can draw
if [ $code -eq 0 ]; then
  [ "$(head -c 8 errors.png | od -An -tx1 | tr -d ' ')" = 89504e470d0a1a0a ] || fail "no PNG"
fi
"$supine" validate scanned.safetensors --state supine:rest+400.ply --state supine:rest+900.ply \
  --state supine:rest+1500:rest+1500.ply --state prone:rest:prone.ply --from supine:rest --json >valid.json ||
  fail "validate several"
for state in 1 6 11 16; do # predicted; "none" comes next
  near "$(number rms_mm valid.json $state)" 0 0.01 || fail "state $state is not predicted"
  near "$(number rms_mm valid.json $((state + 1)))" 0 0.5 && fail "state $state did not move"
done
near "$(number volume_ml valid.json)" 400 1 || fail "volume $(number volume_ml valid.json)"
near "$(number volume_ml valid.json 3)" 1500 1 || fail "volume $(number volume_ml valid.json 3)"
[ "$(number states valid.json)" = 3 ] || fail "states of one posture"
near "$(number off_percent valid.json)" 2.5 2.5 || fail "line off by $(number off_percent valid.json)"
near "$(number nearest_scale valid.json 2)" "$(number scale valid.json 2)" 0.001 ||
  fail "not the nearest scale"
"$supine" validate scanned.safetensors --state supine:rest+400.ply --from supine:rest+900 --json \
  >valid.json || fail "validate from another state"
near "$(number volume_ml valid.json)" -500 1 || fail "from: $(number volume_ml valid.json)"

# Points that a basis of no patient's law turns go by its surface's displacement.
vertices() { # FILE: x y z of its vertices
  awk '/^v / { print $2 "," $3 "," $4 }' "$1"
}
for posture in supine prone; do
  "$supine" deform scanned.safetensors --posture $posture --volume rest -o $posture.obj >/dev/null ||
    fail "deform to OBJ"
done
{
  echo x,y,z,to_x,to_y,to_z
  vertices supine.obj >from.csv
  vertices prone.obj | paste -d, from.csv - | awk 'NR % 5 == 1'
} >turned.csv
"$supine" validate scanned.safetensors --landmarks turned.csv --posture prone --volume rest --json \
  >valid.json || fail "validate points that were turned"
near "$(number rms_mm valid.json)" 0 0.01 || fail "points are $(number rms_mm valid.json) mm off"
near "$(number rms_mm valid.json 2)" 0 5 && fail "points did not turn"

# Other postures tell the gain: by surfaces, by landmarks, or both; one posture does not.
"$supine" precompute rest.ply --scanned none --law deep --constants 5,2.2,9,1.1,20,1.4 --base 0.9 \
  --gain 0.4 --box-force 0,-0.2,0 --band 15 -o known.safetensors >/dev/null || fail "a known law"
"$supine" deform known.safetensors --posture supine --volume scan+900 -o wide.ply >/dev/null || fail deform
"$supine" deform known.safetensors --posture prone --volume scan+600 -o down.ply >/dev/null || fail deform
"$supine" deform known.safetensors --posture supine --volume scan+500 -o half.ply >/dev/null || fail deform
"$supine" fit rest.ply --state supine:wide.ply --state prone:+600:down.ply -o two.json --json \
  >fit.json || fail "fit two states"
near "$(number gain fit.json)" 0.4 0.03 || fail "gain $(number gain fit.json)"
near "$(number gain_standard_error fit.json)" 0.02 0.02 || fail "its error"
for state in supine:0:zero supine:900:wide prone:600:down; do
  posture=${state%%:*}
  volume=${state#*:}
  "$supine" deform known.safetensors --posture "$posture" --volume "${volume%:*}" \
    -o "${state##*:}.obj" >/dev/null || fail "deform to OBJ"
  {
    echo x,y,z,to_x,to_y,to_z
    vertices zero.obj >from.csv
    vertices "${state##*:}.obj" | paste -d, from.csv - | awk 'NR % 3 == 1'
  } >"${state##*:}.csv"
done
"$supine" fit --landmarks wide.csv --state prone:+600:down.csv -o three.json --json >fit.json ||
  fail "fit two sets of landmarks"
near "$(number gain fit.json)" 0.4 0.03 || fail "gain of landmarks $(number gain fit.json)"
"$supine" fit rest.ply wide.ply half.ply >fit.txt || fail "fit more operands"
grep -q 'supine: breath scale 0.5' fit.txt || fail "half a breath: $(grep scale fit.txt)"
grep -q 'one posture cannot tell' fit.txt || fail "a gain out of nothing"

# Landmarks: vertices of the two, every second, with half a millimetre of noise.
"$supine" solve rest.ply --posture supine --reach 10 --base 0.9 --gain 0.4 --box-force 0,-0.2,0 \
  --constants 5,2.2,9,1.1,20,1.4 --scale 30 -o state.obj >/dev/null || fail "solve to OBJ"
"$supine" solve rest.ply --posture supine --reach 10 --scale 0.000001 -o rest.obj >/dev/null ||
  fail "solve at rest"
{
  echo x,y,z,to_x,to_y,to_z
  vertices rest.obj >from.csv
  vertices state.obj | awk -F, 'BEGIN { srand(7) } {
    printf "%.4f,%.4f,%.4f\n", $1 + rand() - 0.5, $2 + rand() - 0.5, $3 + rand() - 0.5 }' >to.csv
  paste -d, from.csv to.csv | awk 'NR % 2 == 1'
} >pairs.csv
# One affine map of both lungs, by its surface.
awk '/^v / { printf "v %.5f %.5f %.5f\n", 1.06 * $2 + 3, 0.97 * $3 - 4, 1.08 * $4 - 6; next } { print }' rest.obj >affine.obj
"$supine" fit rest.ply affine.obj --law affine --json >fit.json || fail "fit an affine surface"
near "$(number fitted_rms_mm fit.json)" 0 2.5 || fail "affine: $(number fitted_rms_mm fit.json) left"
for law in paper affine quadratic; do
  "$supine" fit --landmarks pairs.csv --law $law -o points.json --json >fit.json || fail "fit $law"
  "$supine" validate points.json --landmarks pairs.csv --json >valid.json || fail "validate $law"
  near "$(number fitted_rms_mm fit.json)" "$(number rms_mm valid.json)" 1e-6 ||
    fail "$law: $(number fitted_rms_mm fit.json) is not $(number rms_mm valid.json)"
  "$supine" precompute rest.ply --patient points.json --reach 10 -o points.safetensors >/dev/null ||
    fail "precompute $law"
  "$supine" validate points.safetensors --landmarks pairs.csv --state state.ply --json >basis.json ||
    fail "validate the basis of $law"
  near "$(number rms_mm basis.json 6)" "$(number rms_mm valid.json)" 1e-6 ||
    fail "$law: the basis leaves $(number rms_mm basis.json 6)"
done

# What is refused, with its exit code.
refused() { # CODE WORDS COMMAND...
  code=$1
  words=$2
  shift 2
  "$supine" "$@" >out 2>&1
  got=$?
  [ $got -eq "$code" ] || fail "exit code $got of $*: $(cat out)"
  grep -q -- "$words" out || fail "'$words' is not in: $(cat out)"
}
refused 1 'against what' validate points.safetensors
refused 1 'make a basis of it first' validate points.json --state state.ply
refused 1 'knows its own posture only' validate points.json --landmarks pairs.csv --posture prone
refused 1 'what to fit to' fit rest.ply
refused 1 'tell the gain' fit --landmarks pairs.csv --gain 0.3 --state prone:pairs.csv
refused 1 'name the one at rest' fit --landmarks pairs.csv --state prone:state.ply
refused 2 'the same as the one at rest' fit rest.ply rest.ply
for beside in '--law deep' '--base 1' '--gain 0.3' '--box-force 0,0,0' '--constants 1,1,1,1,1,1' \
  '--direction normal' '--scanned full' '--resting prone=0.5'; do
  refused 1 "leave ${beside%% *} out" precompute rest.ply --patient points.json $beside \
    -o x.safetensors
done
refused 1 'leave --expandability out' precompute rest.ply --patient stiff.json \
  --expandability linear:z:0.5:1.5 -o x.safetensors
refused 1 'is of surfaces' fit --landmarks pairs.csv --expandability
refused 1 'the affine law has no force' fit rest.ply stiff.ply --law affine --expandability
echo '{}' >fit.csv
refused 2 'not a patient' precompute rest.ply --patient fit.csv -o x.safetensors
awk -F, 'NR == 1 { print; next } { printf "%s,%s,%s,%s,%s,%s\n", $1+900, $2, $3, $4+900, $5, $6 }' \
  pairs.csv >far.csv
"$supine" fit --landmarks far.csv -o far.json >/dev/null || fail "fit far away"
refused 2 'another frame, unit or person' precompute rest.ply --patient far.json -o x.safetensors
refused 2 'another frame, unit or person' validate points.safetensors --landmarks far.csv
[ ! -e x.safetensors ] || fail "a refused command left a file"
echo passed
