#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Compile the C# example of BINDINGS.md, deform a basis with it, and compare the positions with those of the C library:
#
#     test_csharp.sh SOURCE_FOLDER LIBRARY SUPINE CC MCS MONO
set -eu
source=$1 library=$2 supine=$3 cc=$4 mcs=$5 mono=$6
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
"$supine" phantom -o "$work/lungs.ply" --vertices 700 >"$work/log"
"$supine" precompute "$work/lungs.ply" -o "$work/lungs.safetensors" >>"$work/log"
"$cc" -I"$source/runtime/include" "$source/tests/python/reference.c" "$library" -o "$work/reference"
export LD_LIBRARY_PATH="${library%/*}"
"$work/reference" "$work/lungs.safetensors" prone:rest+500 "$work/expected"
# The file of expected results has 60 bytes for each vertex. It begins with the positions of all vertices.
vertices=$(($(wc -c <"$work/expected") / 60))
{
  echo 'using System; using System.IO; using System.Runtime.InteropServices; static class Test {'
  sed -n '/^```c#$/,/^```$/p' "$source/runtime/BINDINGS.md" | sed '1d;$d'
  cat <<'END'
  static void Main(string[] arguments) {
    SupineError error = new SupineError();
    IntPtr basis;
    byte[] state = new byte[112];
    double[] pose = new double[256 + 16 * 3 + 1];
    float[] xyz = new float[3 * int.Parse(arguments[2])];
    if (supine_basis_open("absent", out basis, ref error) == 0 || error.message[0] == 0) Environment.Exit(2);
    if (supine_basis_open(arguments[0], out basis, ref error) != 0) Environment.Exit(3);
    if (supine_state_parse(arguments[1], state, ref error) != 0) Environment.Exit(4);
    if (supine_basis_pose(basis, state, pose, ref error) != 0) Environment.Exit(5);
    if (supine_deform(basis, pose, xyz) != 0) Environment.Exit(6);
    byte[] bytes = new byte[4 * xyz.Length];
    Buffer.BlockCopy(xyz, 0, bytes, 0, bytes.Length);
    File.WriteAllBytes(arguments[3], bytes);
  }
}
END
} >"$work/test.cs"
"$mcs" -out:"$work/test.exe" "$work/test.cs"
"$mono" "$work/test.exe" "$work/lungs.safetensors" prone:rest+500 "$vertices" "$work/found"
cmp -n "$((12 * vertices))" "$work/expected" "$work/found"
[ "$(wc -c <"$work/found")" -eq "$((12 * vertices))" ]
