#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Precompute the basis of real lungs, and deform, draw and export them: demo.sh PROGRAM FOLDER
set -eu
supine=$1
folder=$2
lungs=$(dirname "$0")/../examples/lungs
mkdir -p "$folder"
"$supine" precompute "$lungs/left.obj" "$lungs/right.obj" -o "$folder/lungs.safetensors"
"$supine" embed "$folder/lungs.safetensors" "$lungs/targets.csv" "$lungs/airways.ply" -o "$folder/inside.safetensors"
"$supine" export "$folder/lungs.safetensors" --inside "$folder/inside.safetensors" \
  --title "Lungs: test data of Chaste, University of Oxford (BSD-3-Clause). Targets and airways are fictitious." \
  -o "$folder/lungs.html"
for posture in supine prone left right; do
  "$supine" deform "$folder/lungs.safetensors" --posture $posture -o "$folder/$posture.vtp"
done
pictures=""
if "$supine" render "$folder/lungs.safetensors" --inside "$folder/inside.safetensors" --posture supine,left,prone \
  -o "$folder/postures.png" &&
  "$supine" render "$folder/lungs.safetensors" --inside "$folder/inside.safetensors" \
    --posture supine,left,prone,supine --size 600x440 -o "$folder/postures.webp"; then
  pictures="  postures.png         three postures side by side
  postures.webp        a film: the lungs turn from the back to the left side and the belly, and back, beside those on the back"
fi
cat <<END

Made in $folder/, from the lungs of an adult (test data of Chaste, University of Oxford, BSD-3-Clause;
the tumour, the nodule and the airways are fictitious):
  lungs.html           a page for a browser: where the tumour goes in any posture
  lungs.safetensors    the basis of the lungs, for every direction of gravity and every volume
  inside.safetensors   the tumour, the nodule and the airways, which move with the lungs
  supine.vtp prone.vtp left.vtp right.vtp
                       the lungs at rest, lying on the back, the belly and either side
$pictures

Open $folder/lungs.html in any browser, or the four .vtp files in ParaView, coloured by displacement_magnitude.
A further example: $supine deform $folder/lungs.safetensors --posture 0.6:0:-0.8:rest+800 -o mine.ply
END
