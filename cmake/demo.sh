#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Make synthetic lungs, precompute their basis, and deform and draw them: demo.sh PROGRAM FOLDER
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
  picture="  postures.png         the four postures side by side"
fi
cat <<END

Made in $folder/:
  lungs.ply            a pair of lungs at full inflation
  lungs.safetensors    their basis, for every direction of gravity and every volume
  supine.vtp prone.vtp left.vtp right.vtp
                       the lungs at rest, lying on the back, the belly and either side
  lungs.html           a page for a browser, in which the lungs turn and breathe
$picture

To view them, open $folder/lungs.html in any browser, or the four .vtp files in ParaView,
coloured by displacement_magnitude.
A further example: $supine deform $folder/lungs.safetensors --posture 0.6:0:-0.8:rest+800 -o mine.ply
END
