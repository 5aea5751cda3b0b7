# Every target works on a fresh machine that has only make and Python 3.11 or newer.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# What is installed in it: the program alone, with what make test needs, with all that development needs.
INSTALLED := $(VENV)/.installed
TESTABLE := $(VENV)/.testable
READY := $(VENV)/.ready
PYTHON311 ?= python3.11
LOWEST := .venv-lowest

.PHONY: setup run test test-all lint figures same bench claims held-out constants baselines soak mutants walk lowest site clean

setup: $(READY)

$(TESTABLE): EXTRAS := [test]
$(READY): EXTRAS := [dev]
$(INSTALLED) $(TESTABLE) $(READY): pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.$(EXTRAS)'
	touch $(INSTALLED) $(if $(EXTRAS),$(TESTABLE)) $@

run: $(INSTALLED)  ## the whole job on the virtual arm, into runs/first
	mkdir -p runs
	$(BIN)/pneumarm run --out runs/first

test: $(TESTABLE)  ## what proves the whole in some minutes
	$(BIN)/python -m pytest -n 3 --dist worksteal -m 'not soak and not walk and not thorough'

test-all: setup  ## all tests but soak and walk
	$(BIN)/python -m pytest -n 3 --dist worksteal

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

figures: setup  ## counts that describe the code: lines, names, numbers, settings, options
	$(BIN)/python tools/figures.py

same: setup  ## whether results are those of another revision, byte for byte: make same BASE=main
	$(BIN)/python tools/same_results.py $(BASE)

bench: setup
	$(BIN)/python -m benchmarks

claims: setup  ## which of the thesis' conclusions hold: all experiments, and docs/claims.md from their rows; hours (SIZE=full: two nights), a second call goes on
	$(BIN)/pneumarm claims --size $(or $(SIZE),pilot) --out runs/claims --published docs

held-out: setup  ## the whole job on the ten held-out arms; takes about ten minutes
	$(BIN)/python -m benchmarks held_out

constants: setup  ## which constants decide how an arm moves: each at half and at one and a half times its value, into runs/constants; takes nights, a second call goes on
	$(BIN)/python -m benchmarks constants

baselines: setup  ## the table of baselines on the held-out arms, into runs/baselines; takes hours, a second call goes on
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev,stable-baselines]'
	$(BIN)/python -m benchmarks baselines

soak: setup  ## attacks, in about an hour: kills, power cuts, hostile files, bad lines, damaged frames; see CONTRIBUTING.md
	$(BIN)/python -m pytest -m soak -s

mutants: $(if $(QUICK),$(TESTABLE),$(READY))  ## changes the program in one place at a time: tests must fail; ONLY=name for one, or a package; QUICK=1 for one in each folder, by what make test runs; minutes, a second call goes on
	$(BIN)/python tests/mutate.py $(if $(ONLY),--only '$(ONLY)') $(if $(QUICK),--quick)

walk: setup  ## a new user's walk: the wheel in a fresh environment, every command of the README and its pages; takes minutes
	$(BIN)/python -m pytest -m walk -s

lowest:  ## the quick tests with Python 3.11 and the oldest versions that are allowed, without extras; after changes of kernels
	test -x $(LOWEST)/bin/python || $(PYTHON311) -m venv $(LOWEST)
	sed -n '/^dependencies/,/^]/s/^ *"\([a-z0-9-]*\)>=\([0-9.]*\).*/\1==\2/p' pyproject.toml > $(LOWEST)/oldest.txt
	$(LOWEST)/bin/pip install --quiet --disable-pip-version-check --constraint $(LOWEST)/oldest.txt --editable . pytest hypothesis psutil
	$(LOWEST)/bin/python -m pytest tests/test_kernels.py tests/test_vectors.py tests/test_public_interfaces.py tests/arm/test_*.py tests/networks tests/simulation tests/task tests/planning tests/transitions/test_store.py tests/transitions/test_window.py

site: setup  ## the documentation as pages to be read in a browser, into site/
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[docs]'
	$(BIN)/python -m mkdocs build

clean:
	rm -rf $(VENV) $(LOWEST) runs site .mutants .pytest_cache .ruff_cache .mypy_cache
