#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Check the messages and exit codes of 'supine fit' for refused input: test_patient_refused.sh PROGRAM
#
# Landmarks and surfaces are refused if the two states differ in their frame, their unit or their side, if they do not
# overlap, are mirrored or shuffled, or if values are too few or not numbers.
set -u
supine=$1
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
fail() {
  echo "FAILED: $*"
  exit 1
}
# refused CODE WORDS ARGUMENTS...: check that `fit` ends with this code, its output has these words, and no file is left.
refused() {
  code=$1
  words=$2
  shift 2
  "$supine" fit "$@" -o law.json >out 2>&1
  got=$?
  [ $got -eq "$code" ] || fail "exit code $got, not $code, of fit $*: $(cat out)"
  grep -q -- "$words" out || fail "'$words' is not in: $(cat out)"
  [ ! -e law.json ] || fail "fit $* left a file"
}

# Landmarks: sixty points in two lungs, moved as in a breath.
awk 'BEGIN {
  srand(11)
  print "x,y,z,to_x,to_y,to_z"
  for (i = 0; i < 60; ++i) {
    side = i % 2 ? 1 : -1
    X = rand(); Y = rand(); Z = rand()
    x = side * (15 + 100 * X); y = -10 - 140 * Y; z = 40 - 230 * Z
    printf "%.3f,%.3f,%.3f,%.3f,%.3f,%.3f\n", x, y, z, x + side * 6 * X * X, y - 9 * Y, z - 20 * Z
  }
}' >good.csv
"$supine" fit --landmarks good.csv --rest 2600mL --other 5400mL -o good.json >/dev/null || fail "fit refuses good landmarks"
# changed NAME AWK: write NAME.csv from good.csv with each row changed by an awk statement.
changed() {
  awk -F, -v OFS=, "NR == 1 { print; next } { $2; print }" good.csv >"$1.csv"
}
changed apart '$4 += 150; $5 += 150; $6 += 150'
refused 2 'mm apart: give all points in one coordinate frame, or fit the motion between the scans; give --translation' --landmarks apart.csv
"$supine" fit --landmarks apart.csv --translation --rest 2600mL --other 5400mL >/dev/null || fail "fit --translation refuses shifted landmarks"
changed beyond '$6 += 5000'
refused 2 'mm apart: give all points in one coordinate frame' --landmarks beyond.csv
changed centimetres '$4 /= 10; $5 /= 10; $6 /= 10'
refused 2 'the unit may be cm: give landmarks in mm' --landmarks centimetres.csv
changed both '$1 /= 10; $2 /= 10; $3 /= 10; $4 /= 10; $5 /= 10; $6 /= 10'
refused 2 'the unit may be cm: give landmarks in mm' --landmarks both.csv
changed sides '$4 = -$4'
refused 2 'differ by a reflection' --landmarks sides.csv
changed ras '$4 = -$4; $5 = -$5'
refused 2 'give both in LPS axes' --landmarks ras.csv --translation
changed same '$4 = $1; $5 = $2; $6 = $3'
refused 2 'the points do not move between the states' --landmarks same.csv
changed shifted '$4 = $1; $5 = $2; $6 = $3 + 5'
refused 2 'mm RMS after a translation): give two different states' --landmarks shifted.csv --translation
changed flat '$2 = 17 + 0.3 * $1; $5 = $2 - 3'
refused 2 'points lie in one plane' --landmarks flat.csv
awk -F, -v OFS=, 'NR == 1 { print; next } { from[NR] = $1 OFS $2 OFS $3; to[NR] = $4 OFS $5 OFS $6 }
  END { for (i = 2; i <= NR; ++i) { print from[i], to[2 + (7 * i) % (NR - 1)] } }' good.csv >shuffled.csv
refused 2 'in the same order' --landmarks shuffled.csv
sed '20s/,[^,]*$/,nan/' good.csv >nan.csv
refused 2 'nan.csv:20: to_z "nan" is not a finite number' --landmarks nan.csv
sed '30s/.*/1,2,3,4,5/' good.csv >short.csv
refused 2 'short.csv:30' --landmarks short.csv
head -12 good.csv >eleven.csv
refused 2 'pairs of points: 11, but at least 12 are needed' --landmarks eleven.csv
refused 2 'pairs of points: 11' --landmarks good.csv --rest 2600mL --other 5400mL --state prone:rest:eleven.csv
head -15 good.csv >few.csv
refused 2 'points: 14, fewer than the 15 unknowns of the paper law' --landmarks few.csv --rest 2600mL --other 5400mL --law paper --rigid
refused 1 'takes deep or paper' --landmarks good.csv --law quadratic
head -1 good.csv >none.csv
refused 2 'no pairs of points' --landmarks none.csv
sed '1s/,to_z//' good.csv >header.csv
refused 2 'no column "to_z"' --landmarks header.csv
refused 2 'No such file' --landmarks absent.csv
refused 1 'nothing to fit to' --name nobody
refused 1 'give --translation or --rigid, not both' --landmarks good.csv --translation --rigid

# Surfaces instead of points: pair.obj holds two synthetic lungs, and `half` writes each into a file of its own.
"$supine" phantom -o pair.obj --vertices 700 >/dev/null || fail "phantom"
# half NAME 0|1: write NAME.obj with the first or the second lung of the pair.
half() {
  awk -v second="$2" '/^v / { v[++n] = $0 } /^f / { f[++m] = $0 }
    END {
      for (i = 1; i <= n / 2; ++i) { print v[second * n / 2 + i] }
      for (i = 1; i <= m / 2; ++i) {
        split(f[second * m / 2 + i], c, " ")
        print "f", c[2] - second * n / 2, c[3] - second * n / 2, c[4] - second * n / 2
      }
    }' pair.obj >"$1.obj"
}
half rest 0
half other 1
# moved NAME AWK: write NAME.obj from rest.obj with each vertex changed by an awk statement.
moved() {
  awk "/^v / { x = \$2; y = \$3; z = \$4; $2; print \"v\", x, y, z; next } { print }" rest.obj >"$1.obj"
}
moved state 'y *= 1.05; z *= 1.08'
"$supine" fit rest.obj state.obj -o good.json >/dev/null || fail "fit refuses good surfaces"
refused 2 'the two surfaces are the same' rest.obj rest.obj
moved far 'z += 400'
refused 2 'overlap too little along z' rest.obj far.obj
refused 2 'overlap too little along x' rest.obj other.obj
moved cm 'x /= 10; y /= 10; z /= 10'
refused 2 'give --units mm' rest.obj cm.obj
refused 2 'give --units mm' cm.obj rest.obj
moved turned 'x = -x; y = -y'
refused 2 'overlap too little along' rest.obj turned.obj
moved left 'x = -x'
refused 2 'overlap too little along x' rest.obj left.obj
# changed_pair NAME AWK: write NAME.obj from pair.obj with each vertex changed by an awk statement.
changed_pair() {
  awk "/^v / { x = \$2; y = \$3; z = \$4; $2; print \"v\", x, y, z; next } { print }" pair.obj >"$1.obj"
}
changed_pair breath 'y *= 1.05; z *= 1.08'
"$supine" fit pair.obj breath.obj -o good.json >/dev/null || fail "fit refuses a good pair of lungs"
sed '5s/[-0-9.e]*$/nan/' state.obj >broken.obj
refused 2 'broken.obj' rest.obj broken.obj
refused 2 'No such file' rest.obj absent.obj
refused 2 'give each lung once' rest.obj,rest.obj state.obj
refused 1 'more than two surfaces' rest.obj,other.obj,state.obj state.obj
refused 1 'nothing to fit to' --state prone:state.obj
refused 2 'of the vertices have a normal like that of the nearest point' rest.obj state.obj --state prone:far.obj
refused 2 'mm apart' --landmarks apart.csv rest.obj state.obj
echo passed
