# Needs make, gcc, git or not, and any Python >= 3.11; everything else goes into $(VENV).
SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help demo test lint warm unit elsewhere browser verify coverage bench docs pictures explore clean fuzz mutants lowest

VENV ?= .venv
WORKERS ?= 2
# The first interpreter that starts and is recent enough. Name your own with `make PYTHON=/path/to/python ...`.
PYTHON ?= $(shell for p in python3.11 python3 python3.12 python3.13 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && echo $$p && break; done)

# Byte code is kept whatever the shell says: the tests start many processes.
unexport PYTHONDONTWRITEBYTECODE

BIN := $(VENV)/bin
# Byte code is made by the first import: for all modules of all packages it takes longer than the rest of an install.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
RIG := precision_stage

help:
	@echo 'make demo      predict and simulate $(RIG), with pictures in demo/'
	@echo 'make test      every check without a browser: style, types, imports, equations, tests'
	@echo 'make lint      the same without the tests'
	@echo 'make elsewhere the kept numbers and texts, as another processor computes them; ONLY=... picks some'
	@echo 'make browser   the journeys through the browser app; ONLY=... picks some; skipped without a chromium'
	@echo "make verify    the paper's claims, solver against solver, slow tests (half an hour); report in verification/"
	@echo 'make coverage  lines that the tests go through, slow ones too; the kernels as plain Python'
	@echo 'make bench     each fast path beside the plain loop it replaces; fails on a broken promise'
	@echo 'make fuzz      new wrong input all the time, for MINUTES=10'
	@echo 'make mutants   one operator turned at a time, COUNT=20 of them: do the tests notice?'
	@echo 'make lowest    the tests with the lowest versions of all dependencies'
	@echo 'make docs      the documentation, in docs/_build'
	@echo 'make pictures  the pictures in docs/images, which are kept: they take a browser, or minutes'
	@echo 'make explore   the browser app'
	@echo 'make clean     remove $(VENV), demo/ and all caches'

# ---------------------------------------------------------------- what a person runs

demo: $(VENV)/.runtime
	@mkdir -p demo
	$(BIN)/stickslip predict $(RIG) --plot demo/predict.png
	$(BIN)/stickslip simulate $(RIG) -o demo/run.nc --plot demo/run.png
	@echo
	@echo 'The verdict is drawn in $(CURDIR)/demo/predict.png'
	@echo 'The run is drawn in     $(CURDIR)/demo/run.png and kept in $(CURDIR)/demo/run.nc'

test: $(VENV)/.dev
	@$(MAKE) --no-print-directory -j2 lint warm
	@$(MAKE) --no-print-directory unit

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python tools/equations.py

# Kernels compile once, on the core that the checks of style leave free, before workers share them.
warm: $(VENV)/.dev
	$(BIN)/python tests/warm.py

# A test that takes far more than 2 s of CPU time is listed, unless it is marked. conftest.py puts long files first.
unit: warm
	$(BIN)/python -m pytest -q -n $(WORKERS) --dist loadfile --no-loadscope-reorder -m "not slow and not browser" --at-most 2

# What users have had, computed once more as another processor would: our kernels in the instructions of the first
# x86-64, OpenBLAS for an old processor of Intel, which decides how it sums. Kernels are compiled anew, in a cache of
# their own: five minutes of one core for all, less with ONLY, an expression for `pytest -k`.
ELSEWHERE := OPENBLAS_CORETYPE=Prescott NUMBA_CPU_NAME=x86-64 NUMBA_CPU_FEATURES= NUMBA_CACHE_DIR=$(CURDIR)/.elsewhere
KEPT_TESTS := tests/test_regression.py tests/test_output_texts.py tests/test_paper.py

elsewhere: $(VENV)/.dev
ifeq ($(shell uname -m),x86_64)
	$(ELSEWHERE) $(BIN)/python -m pytest -q -p no:cacheprovider -m "not slow and not browser" $(if $(ONLY),-k "$(ONLY)") $(KEPT_TESTS)
else
	@echo 'make elsewhere: skipped, for this machine is no x86-64: only such processors can be taken for another'
endif

browser: $(VENV)/.dev $(VENV)/.browser
	$(BIN)/python -m pytest -q -m "browser and not slow" $(if $(ONLY),-k "$(ONLY)") tests/test_explorer_journeys.py

verify: $(VENV)/.dev $(VENV)/.browser
	$(BIN)/python -m verification --report verification --workers $(WORKERS)
	$(BIN)/python -m pytest -q -n $(WORKERS) --dist loadfile -m slow

coverage: $(VENV)/.dev
	$(BIN)/python -m pytest -q -n $(WORKERS) --dist loadfile --cov --cov-report=html --cov-report=term:skip-covered

bench: $(VENV)/.dev
	$(BIN)/python -m pytest -q benchmarks --benchmark-only --benchmark-timer=time.process_time --benchmark-columns=min,median,rounds --benchmark-json=.benchmarks.json
	$(BIN)/python tools/bench_table.py .benchmarks.json README.md docs/howto/what-it-costs.md

fuzz: $(VENV)/.dev
	$(BIN)/python tools/fuzz.py $(or $(MINUTES),10) $(SEED)

mutants: .mutants/learnt.json
	$(BIN)/python tools/mutants.py $(or $(COUNT),20) $(SEED)

# Lines move when a module changes: which tests run through them is noted anew, in a quarter of an hour.
.mutants/learnt.json: $(shell find tests src/stickslip -name '*.py') | $(VENV)/.dev
	$(BIN)/python tools/mutants.py --learn

# Slow tests, pages, pictures of the browser and the paper's figures take no other road through the dependencies.
LOWEST_TESTS := rig store units quantities distributions model simulate damaged files sweep sweep_plan measure traces plot cli

lowest: $(VENV)-lowest/.made
	$(VENV)-lowest/bin/python -m pytest -q -m "not slow" $(LOWEST_TESTS:%=tests/test_%.py)

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo 'Open $(CURDIR)/docs/_build/html/index.html'

# The pages draw what they can while they are built; these the README shows, or they take a browser or minutes.
pictures: $(VENV)/.dev $(VENV)/.browser
	$(BIN)/python tools/pictures.py docs/images
	mkdir -p docs/made
	$(BIN)/python examples/practice/regime_diagram.py docs/made/diagram.png docs/images/measured_and_model.png
	STICKSLIP_SCREENSHOTS=docs/images $(BIN)/python -m pytest -q tests/test_explorer_journeys.py -k every_page_fits
	rm -f docs/images/*-phone-dark.png

explore: $(VENV)/.explorer
	$(BIN)/stickslip explore

clean:
	rm -rf $(VENV) $(VENV)-lowest demo build dist docs/_build docs/gallery docs/made htmlcov .benchmarks .benchmarks.json .coverage .hypothesis
	rm -rf .elsewhere .mutants .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find src tests verification benchmarks tools examples -name __pycache__ -prune -exec rm -rf {} + 2>/dev/null || true

# ---------------------------------------------------------------- the environment, made on first use

$(VENV)/bin/python:
	@[ -n '$(PYTHON)' ] || { echo 'No Python >= 3.11 found; name one with PYTHON=...' >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
		echo 'Could not make a virtual environment with $(PYTHON); on Debian: apt-get install python3-venv' >&2; exit 1; }

# A stamp is older than pyproject.toml when the dependencies may have changed.
$(VENV)/.runtime: pyproject.toml | $(VENV)/bin/python
	@echo 'Installing stickslip into $(VENV) (the first time takes a minute or two)'
	$(PIP) -e .
	@touch $@

$(VENV)/.dev: pyproject.toml | $(VENV)/bin/python
	@echo 'Installing stickslip and its development tools into $(VENV) (the first time takes some minutes)'
	$(PIP) -e '.[dev]'
	@touch $(VENV)/.runtime $(VENV)/.explorer $(VENV)/.docs $@

$(VENV)-lowest/.made: pyproject.toml tools/lowest.py
	@rm -rf $(VENV)-lowest && $(PYTHON) -m venv $(VENV)-lowest
	$(VENV)-lowest/bin/python -m pip install --quiet packaging
	$(VENV)-lowest/bin/python tools/lowest.py > $(VENV)-lowest/lowest.txt
	$(VENV)-lowest/bin/python -m pip install --quiet -c $(VENV)-lowest/lowest.txt -e '.[sweep,explorer,traces]' \
		pytest hypothesis httpx sybil
	@touch $@

# For the journeys through the explorer; without a browser they are skipped, and the last line says so.
$(VENV)/.browser: | $(VENV)/.dev
	$(BIN)/python tools/chromium.py
	@touch $@

$(VENV)/.docs: pyproject.toml | $(VENV)/bin/python
	$(PIP) -e '.[docs]'
	@touch $(VENV)/.runtime $@

$(VENV)/.explorer: pyproject.toml | $(VENV)/bin/python
	$(PIP) -e '.[explorer]'
	@touch $(VENV)/.runtime $@
