# `make demo` runs the shipped mission, `make site` builds the documentation, `make test` checks everything; each sets up
# what it needs in .venv first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO := demo
# Three processes for two cores: some tests wait for a browser, a worker or a child. One that crashes ends the run: the
# files that it has left would be waited for in vain.
SIDE_BY_SIDE := --numprocesses 3 --dist loadfile --no-loadscope-reorder --max-worker-restart 0

# Without the bytecode of its modules each command of a test begins half a second later.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test unit within lint types compiled contract numbers endurance benchmark site clean
.DELETE_ON_ERROR:

demo: $(VENV)/.run
	$(BIN)/microrad run missions/leo-geo.toml --output $(DEMO) --overwrite

# What most tests wait for is compiled first, beside the rest of the set-up. Types are checked and the numbers compared beside
# the tests that wait: those are handed out first.
test:
	@$(MAKE) --no-print-directory --jobs=3 FIRST="contract lint compiled" types numbers unit

numbers unit: | $(FIRST)

contract: $(VENV)/.test
	$(BIN)/lint-imports

lint: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.test
	$(BIN)/mypy

compiled: $(VENV)/.compiled

$(VENV)/.compiled: $(VENV)/.run scripts/compile_kernels.py $(wildcard src/microrad/core/kernels/*.py)
	$(BIN)/python scripts/compile_kernels.py
	@touch $@

# Each quantity of the quick cases against reference/; `scripts/numbers check --all` compares all cases. Beside the tests it
# takes the time in which these wait.
numbers: $(VENV)/.test
	nice -n 19 $(BIN)/python scripts/numbers check

# Assertions as they stand: to rewrite those of all files takes each process half a minute. What fails runs once more and
# shows its values.
unit: $(VENV)/.test
	$(BIN)/python -m pytest $(SIDE_BY_SIDE) --durations 10 --assert plain || \
	  { $(BIN)/python -m pytest --last-failed --last-failed-no-failures none; exit 1; }

# The tests, and what functions return inside of them against reference/tests: a minute more. Before and behind a change that
# is meant to move nothing.
within: $(VENV)/.test
	MICRORAD_WITHIN=hold $(BIN)/python -m pytest $(SIDE_BY_SIDE)

# All tests, and what `make test` does once, many times: kills, browser pages at all widths, every key of the mission.
# For a release.
endurance: $(VENV)/.test
	MICRORAD_ENDURANCE=1 $(BIN)/python -m pytest $(SIDE_BY_SIDE) --durations 10

benchmark: $(VENV)/.test
	$(PIP) --constraint constraints.txt --editable '.[benchmark]'
	$(BIN)/python benchmarks/loop.py
	$(BIN)/python benchmarks/ensemble.py
	$(BIN)/python benchmarks/controllers.py
	$(BIN)/python benchmarks/worst_case.py
	$(BIN)/python benchmarks/error_budget.py
	$(BIN)/python benchmarks/flight_step.py
	$(BIN)/python benchmarks/answer.py
	$(BIN)/python benchmarks/link_conventions.py
	$(BIN)/python benchmarks/contacts.py
	$(BIN)/python benchmarks/campaign.py
	$(BIN)/python benchmarks/campaign_tail.py
	$(BIN)/python benchmarks/recording.py
	$(BIN)/python benchmarks/vector_fitting.py
	$(BIN)/python benchmarks/frequency_response_fit.py
	$(BIN)/python benchmarks/hysteresis_fit.py
	$(BIN)/python benchmarks/cubespec_linear.py
	$(BIN)/python benchmarks/cubespec_one_model.py
	$(BIN)/python benchmarks/cubespec_ladder.py
	$(BIN)/python benchmarks/cubespec_residual.py
	$(BIN)/python benchmarks/springs_elsewhere.py
	$(BIN)/python benchmarks/feedforward.py
	$(BIN)/python benchmarks/adaptive_inverse.py
	$(BIN)/python benchmarks/coupled_step.py
	$(BIN)/python benchmarks/studio_map.py

# The documentation as HTML, in site/: pages of docs/, references from the code, validation; notebooks are run.
site: $(VENV)/.test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python scripts/build_site.py site

clean:
	rm -rf $(VENV) $(DEMO) site

# Debian ships python3 without venv; where that is so it is installed, or the command to do so is shown.
$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "microrad needs Python 3.11 or newer: $(PYTHON) is $$($(PYTHON) --version 2>&1); try make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	@$(PYTHON) -m venv $(VENV) >/dev/null 2>&1 || { rm -rf $(VENV); sh scripts/install-venv "$(PYTHON)" && $(PYTHON) -m venv $(VENV); }

# On the machines below each file that is installed is held against its hash, those that build the project among them;
# elsewhere its version alone is (scripts/hashes.py). Bytecode is made of what is used, when it is first used.
PIP := $(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check
MACHINE := $(shell $(PYTHON) -c 'import platform as p, sys; print(p.system(), p.machine(), p.libc_ver()[0], "3.%d" % sys.version_info[1], sep="-")' 2>/dev/null)
ifneq ($(filter $(MACHINE),$(foreach minor,11 12 13 14,Linux-x86_64-glibc-3.$(minor))),)
$(VENV)/.run: $(VENV)/bin/python pyproject.toml CHANGELOG.md hashes/lab.txt
	$(PIP) --require-hashes --requirement hashes/lab.txt
	$(PIP) --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/.test: $(VENV)/.run hashes/test.txt
	$(PIP) --require-hashes --requirement hashes/test.txt
	@touch $@
else
$(VENV)/.run: $(VENV)/bin/python pyproject.toml CHANGELOG.md constraints.txt
	$(PIP) --constraint constraints.txt --editable '.[lab]'
	@touch $@

$(VENV)/.test: $(VENV)/.run
	$(PIP) --constraint constraints.txt --editable '.[test]'
	@touch $@
endif
