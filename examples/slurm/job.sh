#!/bin/bash
# Any command of pneunet that goes on where it was, as a SLURM job on one or more nodes:
#
#   sbatch examples/slurm/job.sh study STUDY.toml -o out/study
#   sbatch examples/slurm/job.sh campaign CAMPAIGN.toml -o out/campaign
#   sbatch --ntasks=4 --time=2:00:00 examples/slurm/job.sh solve DESIGN.toml --resume
#
# Two minutes before its time is over the job ends its ranks and goes back into the queue, as it does when its
# node is taken away. What is on disk is not computed again. PNEUNET tells which pneunet runs: a path, or
# `apptainer exec image.sif pneunet`.
#SBATCH --job-name=pneunet
#SBATCH --ntasks=33             # of a study: one hands out, 32 cases at once; of a solve: 2 to 8 share one body
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=4G
#SBATCH --time=12:00:00
#SBATCH --signal=B:USR1@120
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.log

export OMP_NUM_THREADS=1

back_into_the_queue() {
    echo "job: time is over, back into the queue"
    kill -USR1 "$ranks" # which mpirun hands on: they end in order
    wait "$ranks"
    scontrol requeue "$SLURM_JOB_ID"
}
trap back_into_the_queue USR1

pneunet=(${PNEUNET:-pneunet})
[ ! -x "${PNEUNET:-}" ] || pneunet=("$PNEUNET") # a path, spaces and all
mpirun "${pneunet[@]}" "$@" &
ranks=$!
wait "$ranks"
