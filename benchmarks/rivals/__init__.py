"""The same ramp solved by three codes: pneunet (dolfinx and MUMPS), FElupe and NGSolve (both with MKL
PARDISO).

`ramp` (what is compared) and one module a code; `worker` runs one of them in a process of its own. FElupe and
NGSolve live in an environment of their own, so `ramp`, `worker`, `felupe_body` and `ngsolve_body` import
nothing of pneunet.
"""
