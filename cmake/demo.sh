#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Make synthetic lungs, precompute their basis and deform them: demo.sh PROGRAM FOLDER
set -eu
supine=$1
folder=$2
mkdir -p "$folder"
"$supine" phantom -o "$folder/lungs.ply"
"$supine" precompute "$folder/lungs.ply" -o "$folder/lungs.safetensors"
for posture in supine prone left right; do
  "$supine" deform "$folder/lungs.safetensors" --posture $posture -o "$folder/$posture.vtp"
done
"$supine" export "$folder/lungs.safetensors" -o "$folder/lungs.html"
picture=""
if "$supine" render "$folder/lungs.safetensors" --posture supine,prone,left,right \
  -o "$folder/postures.png"; then
  picture="  postures.png         the four, side by side"
fi
cat <<END

Made in $folder/:
  lungs.ply            a pair of lungs at full inflation
  lungs.safetensors    their basis: every direction of gravity, every volume
  supine.vtp prone.vtp left.vtp right.vtp
                       the lungs at rest, lying on back, belly and either side
  lungs.html           the same lungs to turn and breathe in a browser
$picture

To look at them: open $folder/lungs.html in any browser, or the four .vtp files in ParaView,
coloured by displacement_magnitude.
To go on: $supine deform $folder/lungs.safetensors --gravity 0.6,0,-0.8 --volume rest+800 -o mine.ply
END
