#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Fuzz every reader without libFuzzer, and print the number of inputs:
#
#     tests/fuzz/many.sh BUILD [RUNS [SEED]]      110000 runs by default
#
# Each reader gets RUNS inputs. Network messages are quick and get five times as many. OBJ and STL, which a separate
# process reads, get a 200th of RUNS. Exit with 1 if an input crashed a reader, took more than 0.5 s or used over 2 GB.
set -u
build=$1
runs=${2:-110000}
seed=${3:-1}
source=$(cd "$(dirname "$0")" && pwd)
all=0
failed=0
for reader in ply:mesh:200 stl:mesh:1 vtp:mesh:200 text:text:200 basis:basis:200 message:text:1000 obj:mesh:1 \
  nrrd:image:200 nii:image:200 mha:image:200 points_csv:text:200 points_json:text:200; do
  name=${reader%%:*}
  dictionary=${reader#*:}
  count=$((runs * ${dictionary#*:} / 200))
  said=$("$build/tests/fuzz/fuzz_$name" -runs $count -seed "$seed" -dict "$source/${dictionary%:*}.dict" 2>&1) ||
    { failed=1; echo "FAILED $name: $(echo "$said" | tail -2)"; }
  said=$(echo "$said" | grep 'inputs, slowest')
  echo "$name: $said"
  all=$((all + ${said%% *}))
done
echo "$all inputs in total"
exit $failed
