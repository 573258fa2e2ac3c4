# `make` alone lists what can be made. Everything runs in .venv, which is made on first use.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# one thread for each process: threads of several processes on the same cores slow each other down
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
# bytecode is kept: the tests start hundreds of processes, which would compile the package anew
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo demo-papers demo-import gap test test-long test-fast test-oldest test-newest test-browser check pages models limit kls1 gap-real bench bench-gap bench-gap-quick fuzz faults coverage mutation bounds release lock sbom licences audit-packages docs clean

help: ## list the targets
	@grep -E '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

$(VENV)/.ready: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "soilml needs Python 3.11 or newer; $(PYTHON) is older. Try: make PYTHON=python3.11"; exit 2; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null \
	  || { echo "$(PYTHON) cannot make environments; on Debian: apt install python3-venv"; exit 2; }
	@echo "making the environment in $(VENV) (about a minute) ..."
	@$(PYTHON) -m venv $(VENV)
	@PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install --quiet \
	  --disable-pip-version-check --editable '.[ground,logs,map,serve,sklearn,torch,dev]'
	@touch $@

demo: $(VENV)/.ready ## the story of README: data, training, comparison, a gap, a better board; one picture
	@$(BIN)/python examples/wheel/demo.py

gap: $(VENV)/.ready ## five examples of a model that lacks an effect, with their reports
	@$(BIN)/python examples/gap/run.py

demo-papers: $(VENV)/.ready ## every system of the source papers: pictures, and printed numbers beside computed ones
	@$(BIN)/python examples/papers/run.py

demo-import: $(VENV)/.ready ## from the raw logs of a rig to the soil: map, import report, identification
	@$(BIN)/python examples/import/run.py
	@$(BIN)/python examples/import/wheel_leg.py

test: $(VENV)/.ready ## all checks and tests
	@$(MAKE) --no-print-directory check
	@$(BIN)/python -m pytest -n 2 --dist loadfile -m "not long"

test-long: $(VENV)/.ready ## tests that `make test` leaves out: all versions of the runtime, larger samples
	@$(BIN)/python -m pytest -n 2 --dist loadfile -m long

test-fast: $(VENV)/.ready ## checks, and the tests that neither train nor run a whole workflow, about a minute
	@$(MAKE) --no-print-directory check
	@$(BIN)/python -m pytest -n 2 --dist loadfile -m "not slow and not network and not long"

test-browser: $(VENV)/.ready ## the live page with real clicks; needs Chromium: apt install chromium, or SOILML_CHROMIUM=/path
	@PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install --quiet \
	  --disable-pip-version-check --editable '.[browser]'
	@SOILML_BROWSER=needed $(BIN)/python -m pytest tests/soilml/serve/test_browser.py

check: $(VENV)/.ready ## formatting, types and layers
	@$(BIN)/ruff format --check --quiet . && $(BIN)/ruff check --quiet . && $(BIN)/mypy \
	  && $(BIN)/lint-imports > /dev/null && echo "format, types and layers hold"

pages: $(VENV)/.ready ## write the blocks of pages that commands print; `tools/pages.py --check` compares them, `--quick` in a minute
	@OMP_NUM_THREADS=1 $(BIN)/python tools/pages.py

models: $(VENV)/.ready ## train the released models again, into exported/
	@$(BIN)/python exported/make.py

limit: $(VENV)/.ready ## compute the exact posteriors of the reference sets, seven minutes on two cores
	@$(BIN)/python bench/reference_sets.py

kls1: $(VENV)/.ready ## evaluate the KLS-1 tests: make kls1 SOILML_DATA=/path/to/data
	@$(BIN)/python examples/kls1/run.py

gap-real: $(VENV)/.ready ## gap workflow on published tests, and its page: make gap-real SOILML_DATA=/path/to/data
	@$(BIN)/python examples/gap/real.py --write

bench: $(VENV)/.ready ## measure speed and accuracy, and write bench/results; goes on where it was ended
	@$(BIN)/python bench/run.py

bench-gap: $(VENV)/.ready ## 739 sets with hidden effects against gates and baselines; goes on where it was ended
	@$(BIN)/python bench/run.py gap

bench-gap-quick: $(VENV)/.ready ## a sample of these sets, of a seed to tune on: nothing is written
	@$(BIN)/python bench/run.py gap --quick

fuzz: $(VENV)/.ready ## fuzz every reader and public function, about an hour: make fuzz FUZZ_EXAMPLES=5000
	@FUZZ_EXAMPLES=$(or $(FUZZ_EXAMPLES),5000) $(BIN)/python -m pytest -n 2 tests/fuzz

faults: $(VENV)/.ready ## kill commands at random moments and run them again: make faults FAULT_KILLS=30
	@FAULT_KILLS=$(or $(FAULT_KILLS),30) $(BIN)/python -m pytest tests/faults/test_kills.py

coverage: $(VENV)/.ready ## statements and branches that `make test` reaches, by room, half an hour on two cores
	@PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install --quiet \
	  --disable-pip-version-check --editable '.[coverage]'
	@mkdir -p build
	@$(BIN)/python -m pytest -n 2 --dist loadfile -m "not long" --cov --cov-report=json:build/coverage.json
	@$(BIN)/python tools/reached.py

mutation: $(VENV)/.ready ## change the source at random places and see whether a test fails: make mutation MUTANTS=12
	@PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install --quiet \
	  --disable-pip-version-check --editable '.[mutation]'
	@$(BIN)/python tools/mutation.py --mutants $(or $(MUTANTS),12)

# what the tests need beside the libraries that users install, and the tests that tell versions apart
TEST_LIBRARIES := '.[ground,logs,map,serve,torch]' array-api-strict filelock hypothesis pytest pytest-xdist sympy
TEST_VERSIONS := -m pytest -q -n auto -p no:cacheprovider \
	  -m "not slow and not network and not long and not browser" tests/soilml tests/training tests/datagen

test-oldest: ## quick tests with the oldest libraries that are allowed, twenty minutes on two cores
	@$(PYTHON) -m venv .venv-oldest
	@mkdir -p build && $(PYTHON) tools/oldest.py > build/oldest.txt
	@PIP_CONSTRAINT=build/oldest.txt .venv-oldest/bin/python -m pip install --quiet \
	  --disable-pip-version-check $(TEST_LIBRARIES)
	@SCIPY_ARRAY_API=1 .venv-oldest/bin/python $(TEST_VERSIONS)

test-newest: ## quick tests with the newest libraries that are allowed, ten minutes on two cores
	@$(PYTHON) -m venv .venv-newest
	@.venv-newest/bin/python -m pip install --quiet --upgrade --upgrade-strategy eager \
	  --disable-pip-version-check $(TEST_LIBRARIES)
	@SCIPY_ARRAY_API=1 .venv-newest/bin/python $(TEST_VERSIONS)

bounds: $(VENV)/.ready ## peak memory and time of commands at their largest tables, ten minutes
	@$(BIN)/python tools/bounds.py

docs: $(VENV)/.ready ## the documentation site, with executed tutorials: build/docs/index.html, two minutes
	@PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install --quiet \
	  --disable-pip-version-check --editable '.[docs]'
	@$(BIN)/sphinx-build -q -W --keep-going -E -c docs/site . build/docs
	@echo "build/docs/index.html"

.venv-supply/.ready: Makefile
	@$(PYTHON) -m venv .venv-supply
	@.venv-supply/bin/python -m pip install --quiet --disable-pip-version-check \
	  uv==0.13.9 cyclonedx-bom==7.5.0 pip-audit==2.10.1
	@touch $@

release: $(VENV)/.ready ## build wheel and source archive twice, compare, install and measure them: dist/
	@$(BIN)/python tools/release.py

lock: .venv-supply/.ready ## write the packages with their hashes: tools/supply/
	@$(PYTHON) tools/packages.py lock

sbom: .venv-supply/.ready ## write bills of materials (CycloneDX) into build/
	@$(PYTHON) tools/packages.py sbom

licences: $(VENV)/.ready ## print the licences of the installed packages
	@$(BIN)/python tools/packages.py licences

audit-packages: .venv-supply/.ready ## compare the packages with known faults, by pip-audit
	@$(PYTHON) tools/packages.py audit

clean: ## remove the environment and what demo and tests made
	rm -rf $(VENV) .venv-supply .venv-oldest .venv-newest demo build dist .mypy_cache .ruff_cache .pytest_cache
