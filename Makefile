# make run [SCENARIO=scenarios/...yaml], make view, make test; everything is installed into .venv.
PYTHON ?= python3
SCENARIO ?= scenarios/mixed_0p5hz_10hz.yaml
BIN := .venv/bin
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
# One thread per library: the chain is sequential, and the tests run side by side.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: run view test lint docs linkcheck bench baseline crash changes commands pictures clean fuzz
.DELETE_ON_ERROR:

$(BIN)/python:
	$(PYTHON) -m venv .venv

.venv/installed: pyproject.toml constraints.txt | $(BIN)/python
	$(INSTALL) --editable .
	touch $@

.venv/installed-test: .venv/installed
	$(INSTALL) --editable ".[test]"
	touch $@

# For who wants all of it: resolved once, and compiled on two cores, where pip takes one, the tests of libraries left out;
# a file for another Python fails.
.venv/installed-all: pyproject.toml constraints.txt | $(BIN)/python
	$(INSTALL) --no-compile --editable ".[docs,test]"
	-@$(BIN)/python -m compileall -qq -j 2 -x /tests/ .venv
	touch .venv/installed .venv/installed-docs .venv/installed-test $@

run: .venv/installed
	$(BIN)/testbed run $(SCENARIO)

view: .venv/installed
	@last=$$(ls -1t runs/*/recording.rrd 2>/dev/null | head -n 1); \
	if [ -z "$$last" ]; then echo "no run yet: type 'make run' first" >&2; exit 2; fi; \
	$(BIN)/testbed view "$${last%/*}"

lint: .venv/installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test: lint
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal --durations=15 --durations-min=5

.venv/installed-docs: .venv/installed
	$(INSTALL) --editable ".[docs]"
	touch $@

# The site, gallery included, in docs/_build/html; needs no network once it is installed, and a warning is an error.
docs: .venv/installed-docs
	$(BIN)/python -m sphinx -q -W --keep-going -j 2 -b html -d docs/_build/doctrees docs docs/_build/html

linkcheck: .venv/installed-docs
	$(BIN)/python -m sphinx -q --keep-going -b linkcheck -D plot_gallery=0 docs docs/_build/linkcheck

# 100,000 hostile inputs on two workers, in half an hour; what goes wrong is in runs/fuzz.
fuzz: .venv/installed-test
	$(BIN)/python -m tests.fuzz --cases 100000 --workers 2

# One table at the end: promise, measured, ratio; fails on a miss.
bench: .venv/installed-test
	$(BIN)/python benchmarks/promises.py

# The standard campaign and its short form as they are now become the baseline: make baseline REASON="what moved them".
baseline: .venv/installed-test
	$(BIN)/testbed regress --short --update "$(REASON)"
	$(BIN)/testbed regress --update "$(REASON)"

# Kills at 200 random moments of a run, a report and a training, and disks of 20 sizes: half an hour.
crash: .venv/installed-test
	TESTBED_CRASH_KILLS=200 TESTBED_CRASH_SIZES=20 $(BIN)/python -m pytest -s tests/crash

# The table of commands in docs/commands.md.
commands: .venv/installed-test
	$(BIN)/python -m tests.project.commands

# The picture of the rooms in docs/architecture.md.
pictures: .venv/installed-test
	$(BIN)/python -m tests.project.picture

# What the next release says, from the files in changes/; without --draft it goes into CHANGELOG.md and they go away.
changes: .venv/installed-test
	$(BIN)/towncrier build --draft --version "$$($(BIN)/python -c 'import testbed; print(testbed.__version__)')"

clean:
	rm -rf .venv runs docs/_build docs/gallery docs/reference/generated
