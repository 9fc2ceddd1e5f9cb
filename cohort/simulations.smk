# SPDX-License-Identifier: GPL-3.0-or-later
# Run a plan of simulations of one pair of lungs as jobs, and collect the displacements into one file for
# 'supine precompute --fields':
#
#     supine precompute --directions 24 --volumes 6 >plan.csv
#     snakemake -s cohort/simulations.smk --cores 2 --config plan=plan.csv points=points.csv inputs=lung.inp \
#       simulate='python3 cohort/calculix.py lung.inp'
#
# Each row of plan.csv is a job, named by its state: rows may be added, taken out and moved. It runs the command `simulate` with five more words: x, y and z of the direction of
# gravity, the filling (0: the smallest volume, 1: the largest; 0 without a column fill), and the name of the CSV file
# that it must write: ux,uy,uz of each point of points.csv, in its order and unit. A second run computes only the rows
# that are new or have failed, and all of them if a file in `inputs` (separated by spaces) has changed. With --keep-going,
# a failed simulation does not stop the others; if it cannot be computed, take its row out of the plan.
# Other keys of --config: out=FILE (default: fields.safetensors), runs=FOLDER (default: runs), mem_mb and runtime
# (minutes) of a job. On Slurm, whose accounting (slurmdbd) must run, replace --cores 2 by:
#
#     --slurm --jobs 40 --default-resources slurm_account=ACCOUNT slurm_partition=PARTITION
import sys

here = workflow.basedir
sys.path.insert(0, str(here))
from plan import read_plan

out = config.get("out", "fields.safetensors")
runs = config.get("runs", "runs")

states = read_plan(config["plan"])


rule all:
    input:
        out,


rule collect:
    input:
        points=config["points"],
        plan=config["plan"],
        runs=expand(f"{runs}/{{run}}.csv", run=states),
    output:
        out,
    params:
        runs=runs,
    resources:
        mem_mb=4000,
        runtime=30,
    shell:
        "python3 {here:q}/collect.py {output:q} {input.points:q} {input.plan:q} {params.runs:q}"


rule simulate:
    input:
        config.get("inputs", "").split(),
    output:
        f"{runs}/{{run}}.csv",
    params:
        command=config["simulate"],
        state=lambda wildcards: states[wildcards.run],
    resources:
        mem_mb=config.get("mem_mb", 4000),
        runtime=config.get("runtime", 120),
    shell:
        "{params.command} {params.state} {output:q}"
