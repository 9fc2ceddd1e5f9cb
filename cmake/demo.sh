#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Makes lungs, precomputes their basis and deforms them: demo.sh PROGRAM FOLDER
set -eu
supine=$1
folder=$2
mkdir -p "$folder"
"$supine" phantom -o "$folder/lungs.ply"
"$supine" precompute "$folder/lungs.ply" -o "$folder/lungs.safetensors"
for posture in supine prone left right; do
  "$supine" deform "$folder/lungs.safetensors" --posture $posture --volume 500 \
    -o "$folder/$posture.vtp"
done
echo
echo "Made in $folder/:"
echo "  lungs.ply            a pair of lungs at rest"
echo "  lungs.safetensors    their basis: every direction of gravity, every volume"
echo "  supine.vtp prone.vtp left.vtp right.vtp"
echo "                       the lungs 500 mL fuller, lying on back, belly and either side"
echo "To look at them: open the four .vtp files in ParaView and colour by displacement_magnitude."
echo "To go on: $supine deform $folder/lungs.safetensors --gravity 0.6,0,-0.8 --volume 800 -o mine.ply"
