# The commands of this repository; `make` alone lists them.
VENV  := .venv/bin
DEMO  := $(VENV)/python examples/demo.py
RANKS := 2

# MPI ranks are the only parallelism: no threads beside them, and no remarks on the machine's topology.
export OMP_NUM_THREADS := 1
export HWLOC_HIDE_ERRORS := 2

.PHONY: help setup demo test docs types bench silicones idea image image-test clean
help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 20

setup: ## install what is missing: Debian packages (root or sudo), .venv, pneunet
	@containers/setup.sh

demo: setup ## target curve -> design -> CAD -> finite elements -> report
	$(DEMO)

test: setup ## all tests; those of the finite elements again on 2 ranks
	$(VENV)/python -m pytest -n $(RANKS) --dist worksteal
	$(VENV)/pneunet run -n $(RANKS) -- python -m pytest -q -p no:cacheprovider tests/hifi tests/verification

docs: setup ## run the commands of all pages and build their site, out/docs/index.html
	$(VENV)/python -m docs.site.run -j $(RANKS)
	NO_MKDOCS_2_WARNING=1 $(VENV)/mkdocs build --quiet
	$(VENV)/python -m docs.site.look

types: setup ## mypy and ruff
	$(VENV)/ruff check . && $(VENV)/ruff format --check .
	$(VENV)/python -m tests.typecheck

bench: setup ## measure the figures (ONLY=part for one part)
	$(VENV)/python -m benchmarks $(if $(ONLY),--only $(ONLY))

idea: setup ## the README's picture of the idea (after `make demo`)
	$(VENV)/python -m examples.idea

silicones: setup ## the table of silicones from tensile tests (DATA=folder)
	$(VENV)/python -m benchmarks.silicone_table "$(DATA)"

image: ## container image `pneunet` (podman, docker or buildah)
	@containers/build.sh

image-test: setup image ## the image against this machine: doctor, one FE case, all tests
	@containers/image-test.sh

clean: ## remove results and caches; .venv stays
	rm -rf out build dist *.egg-info .pytest_cache .ruff_cache
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +
