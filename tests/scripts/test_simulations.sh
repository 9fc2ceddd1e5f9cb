#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Run a plan of simulations by a small program in place of a simulator, collect the fields, and make a basis of them:
#
#     test_simulations.sh PROGRAM COHORT [OPTIONS OF SNAKEMAKE]
#
# With snakemake, as jobs; one of them fails at first. Without it, the same commands one by one. The default options are
# --cores 2. On a cluster, use --slurm --jobs 2.
set -u
supine=$1
cohort=$2
shift 2
[ $# -gt 0 ] || set -- --cores 2
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
export HOME="$work" # where snakemake keeps its cache
fail() {
  echo "FAILED: $*"
  exit 1
}
"$supine" phantom --vertices 1000 -o lungs.obj >/dev/null || fail "no lungs"
"$supine" precompute --directions 12 --volumes 3 >plan.csv || fail "no plan"
sed -n 's/^v \([^ ]*\) \([^ ]*\) \([^ ]*\).*/\1,\2,\3/p' lungs.obj >points.csv
cat >simulate.sh <<'SIMULATE'
set -eu
[ -e ready ] || [ "$4" != 1 ] || exit 3
mkdir -p "$(dirname "$5")"
awk -F, -v x="$1" -v y="$2" -v z="$3" -v fill="$4" '{
  printf "%.9g,%.9g,%.9g\n", (0.02 + 0.1 * fill) * $1 + 5 * x, (0.02 + 0.1 * fill) * $2 + 5 * y, (0.02 + 0.1 * fill) * $3 + 5 * z
}' points.csv >"$5"
SIMULATE
if command -v snakemake >/dev/null; then
  flow() {
    snakemake -s "$cohort/simulations.smk" --nocolor --keep-going "$@" --config plan=plan.csv points=points.csv \
      inputs=simulate.sh simulate='sh simulate.sh' >said 2>&1
  }
  flow "$@" && fail "a failed simulation is not told"
  [ "$(ls runs | wc -l)" -eq 24 ] || fail "a failed simulation stops others: $(ls runs | wc -l)"
  touch ready
  flow "$@" || fail "the second run: $(tail -5 said)"
  grep -q '^simulate *12' said || fail "simulations were computed again: $(grep -A6 '^job' said)"
else
  touch ready
  python3 "$cohort/plan.py" plan.csv >states || fail "no states"
  while read -r run x y z fill; do
    sh simulate.sh "$x" "$y" "$z" "$fill" "runs/$run.csv" || fail "run $run"
  done <states
  python3 "$cohort/collect.py" fields.safetensors points.csv plan.csv runs || fail "no fields"
fi
"$supine" precompute lungs.obj --fields fields.safetensors -o lungs.safetensors >said 2>&1 || fail "$(cat said)"
grep -q 'fields of gravity and volume: .* 12 directions, 3 volumes each' said || fail "another plan: $(head -1 said)"
# a row taken out, and the others in another order: each direction keeps its run
sed '5d' plan.csv >fewer.csv
{ head -1 fewer.csv; tail -n +2 fewer.csv | sort; } >sorted.csv
python3 "$cohort/collect.py" some.safetensors points.csv sorted.csv runs || fail "no fields of fewer rows"
"$supine" precompute lungs.obj --fields some.safetensors -o lungs.safetensors >said 2>&1 || fail "$(cat said)"
grep -q warning said && fail "$(cat said)"
first=$(python3 "$cohort/plan.py" plan.csv | sed -n '4s/ .*//p')
rm -f fields.safetensors
echo 1,2 >"runs/$first.csv"
python3 "$cohort/collect.py" fields.safetensors points.csv plan.csv runs 2>said && fail "a corrupt run was collected"
grep -q "runs/$first.csv: line 1 has 2 numbers" said || fail "$(cat said)"
[ ! -e fields.safetensors ] || fail "a file of corrupt runs"
# a deck with letters that are not ASCII, and a CalculiX that prints displacements twice and forces after them
printf '** Lunge, rechts: \303\274 \374\n@X@ @FILL@\n' >deck.inp
cat >ccx <<'CCX'
#!/bin/sh
grep -q '^0.6 0.4$' "$1.inp" || exit 1
printf '\n displacements (vx,vy,vz) for set P and time  0.5E+00\n\n 1 9 9 9\n 2 9 9 9\n' >"$1.dat"
printf '\n displacements (vx,vy,vz) for set P and time  0.1E+01\n\n 2 4 5 6\n 1 1.5E+00 2 3\n' >>"$1.dat"
printf '\n forces (fx,fy,fz) for set P and time  0.1E+01\n\n 1 7 7 7\n 2 7 7 7\n' >>"$1.dat"
CCX
chmod +x ccx
CCX="$work/ccx" python3 "$cohort/calculix.py" deck.inp 0.6 0 0.8 0.4 run.csv || fail "a deck that is not ASCII"
[ "$(tr '\n' ' ' <run.csv)" = "1.5,2,3 4,5,6 " ] || fail "displacements beside forces: $(cat run.csv)"
