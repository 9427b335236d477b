# CIPV Studio. `make demo` shows it, `make test` proves it; neither needs more than Python 3.11, make and git.

# python3, unless some library has no package for its version and another Python is there.
FIT := import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))
PYTHON ?= $(shell for each in python3 python3.13 python3.12 python3.11 python3; do \
  $$each -c '$(FIT)' 2>/dev/null && break; done; echo $$each)
BIN := .venv/bin
PROCESSES ?= 3

# Where this is set, each process compiles every library anew: seconds per start, minutes per run of the tests.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: install demo test check check-types check-layers check-style fix bench docs screenshots suite soak fuzz sbom lock clean

# macOS has GNU make 3.81, which cannot keep the output of two jobs apart.
SYNC := $(if $(filter output-sync,$(.FEATURES)),--output-sync)

# On a terminal, uv shows its own progress bar; in CI and into a file, it only reports errors.
QUIET := $(shell test -t 2 && test -z "$$CI" || echo --quiet)

install: .venv/.compiled

# The lock pins every version; --no-deps-like strictness comes from installing it first and the project without deps.
.venv/.installed: pyproject.toml requirements.lock
	@echo "1/4 environment in .venv, and uv, which installs the rest"
	@test -x $(BIN)/python || $(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("Python 3.11 or newer is \
	needed; $(PYTHON) is " + sys.version.split()[0] + ". Name another with make PYTHON=…")'
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check "uv>=0.5"
	@echo "2/4 $$(grep -c == requirements.lock) libraries at the versions of requirements.lock"
	@$(BIN)/uv pip install $(QUIET) --python $(BIN)/python -r requirements.lock
	@echo "3/4 CIPV Studio itself, from this folder"
	@$(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps -e .
	@touch $@

.venv/.compiled: .venv/.installed
	@echo "4/4 compiling what a first start would wait for, once"
	@$(BIN)/python -m app.commands.support.first_start
	@touch $@
	@echo "installed: make demo shows it"

demo: install
	@$(BIN)/cipv demo

# A file's tests stay in one process: they share servers and browsers; those of tests/accuracy all do: they share what the
# networks saw. Three processes on two cores too: many tests wait for a browser or a sensor's next packet. Five took as
# long, and 9.5 GB. tests/conftest.py says who stays together, orders the files, the long ones first, and keeps half of
# the processes, rounded down, for browsers.
test: .venv/.installed
	@$(MAKE) --no-print-directory --jobs 2 $(SYNC) .venv/.compiled check-types check-layers check-style
	@$(BIN)/python -m pytest -q --numprocesses $(PROCESSES) --dist loadfile --no-loadscope-reorder $(TESTS)

check: .venv/.installed
	@$(MAKE) --no-print-directory --jobs 2 $(SYNC) check-types check-layers check-style

check-types:
	@$(BIN)/mypy

check-layers:
	@$(BIN)/lint-imports --no-cache

check-style:
	@$(BIN)/ruff check app pipeline tests
	@$(BIN)/ruff format --check app pipeline tests

fix: install
	@$(BIN)/ruff check --fix app pipeline tests
	@$(BIN)/ruff format app pipeline tests

bench: install
	@$(BIN)/cipv bench

# The reference pages that are made from the code.
docs: install
	@$(BIN)/python -m tests.docs.reference_pages

# docs/img/*.jpg, from the real page on the simulated drive. Needs Chromium.
screenshots: install
	@$(BIN)/python -m tests.docs.screenshots

# Accuracy on the real recordings, then every experiment of the simulator. Writes build/accuracy.md, build/experiments.*
suite: install
	@mkdir -p build
	@$(BIN)/python -m pytest -q tests/accuracy -s
	@$(BIN)/cipv scenarios run --suite all --report build/experiments.html --drives build/drives --json > build/experiments.json

# Memory over a drive looped 100 times; live sensors for ten minutes with every fault; a day of frames at the display in the
# car (about an hour); and everything failing at random for CHAOS seconds. Writes build/soak*.json.
CHAOS ?= 3600
soak: install
	@mkdir -p build
	@CIPV_CHAOS_SECONDS=$(CHAOS) $(BIN)/python -m pytest -q -m soak tests/soak tests/browser/display/test_all_day.py -s

# Damaged inputs for every parser, `make fuzz SECONDS=3600`, or `make fuzz INPUTS=1000000`, of which each parser gets as
# many as the others (an hour and more). Writes build/fuzz: what was found, and the corpus.
SECONDS ?= 300
fuzz: install
	@$(BIN)/python -m tests.fuzz.run $(if $(INPUTS),--inputs $(INPUTS),--seconds $(SECONDS))

# What the product is made of, with licences and what the wheels bundle: build/sbom.json (CycloneDX), build/licences.md.
sbom: install
	@mkdir -p build
	@$(BIN)/python -m tests.supply.sbom build

lock: install
	@$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --extra dev --no-header --no-annotate --no-emit-index-url \
	  --output-file requirements.lock pyproject.toml
	@$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate \
	  --no-emit-index-url --constraint requirements.lock --output-file requirements-runtime.lock pyproject.toml

clean:
	@rm -rf .venv build dist *.egg-info
