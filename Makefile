# Two commands matter on a fresh machine: `make demo` and `make test`.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin

.PHONY: demo test tests-only test-all coverage check lint lock benchmark docs pictures release clean

demo: $(VENV)/installed
	@$(BIN)/magcomp demo

# Tests start many programs, and each would compile anew what an environment forbids to keep.
test tests-only test-all coverage: export PYTHONDONTWRITEBYTECODE :=
test tests-only test-all coverage: export PYTHONPYCACHEPREFIX := $(CURDIR)/$(VENV)/compiled

# All but what waits or computes for tens of seconds; `make test-all` has that too, and looks
# five times as long for what breaks a parser or a protocol.
# The linters run beside the tests, in the time in which those wait for each other.
test: $(VENV)/installed-dev
	@$(MAKE) --no-print-directory -j 2 lint tests-only

# Three workers for two cores: some tests wait.
tests-only: $(VENV)/collected
	@$(BIN)/python -m pytest -n 3 --dist worksteal -q -m "not slow"

test-all: $(VENV)/installed-dev lint
	@MAGCOMP_EFFORT=5 $(BIN)/python -m pytest -n 2 --dist worksteal -q

coverage: $(VENV)/installed-dev
	@$(BIN)/python -m pytest -n 2 --dist worksteal -q -m "not slow" --cov --cov-report=term

lint: $(VENV)/installed-dev
	@$(BIN)/ruff check magcomp tests benchmarks examples
	@$(BIN)/ruff format --check magcomp tests benchmarks examples
	@$(BIN)/mypy
	@$(BIN)/lint-imports

check: lint

# Needs uv. The lock is what hosted CI installs; `make test` takes what pyproject.toml allows.
lock:
	@uv pip compile pyproject.toml --extra dev --extra fleet --extra docs --extra release --universal --python-version 3.11 --generate-hashes \
	  --no-annotate --quiet -o requirements-dev.lock

benchmark: $(VENV)/installed-dev
	@$(BIN)/python benchmarks/accuracy.py
	@$(BIN)/python benchmarks/coverage.py --seeds 3
	@$(BIN)/python benchmarks/read.py
	@$(BIN)/python benchmarks/fit_time.py
	@$(BIN)/python benchmarks/fleet.py

# The site, with every page of docs/ and the API, into build/docs; a link that leads nowhere fails.
docs: $(VENV)/installed
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	@$(BIN)/python -m sphinx -E -W --keep-going -q -b html docs build/docs
	@echo "build/docs/index.html"

# Wheel, sdist, and what the wheel brings along (CycloneDX), into dist/.
release: $(VENV)/installed
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[release]'
	@rm -rf dist build/fresh
	@$(BIN)/python -m build --outdir dist .
	@$(PYTHON) -m venv build/fresh
	@build/fresh/bin/python -m pip install --quiet --disable-pip-version-check dist/magcomp-*.whl
	@$(BIN)/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible \
	  -o dist/magcomp.cdx.json build/fresh/bin/python
	@ls dist

# Every picture of README.md and docs/ that shows what the program prints or draws; a vehicle flies.
pictures: $(VENV)/installed-dev
	@$(BIN)/python docs/session.py
	@$(BIN)/python docs/pictures.py
	@$(BIN)/python docs/road.py

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit("magcomp needs Python 3.11 or newer") if sys.version_info < (3, 11) else None'
	@$(PYTHON) -m venv $(VENV)

$(VENV)/installed: pyproject.toml | $(VENV)/bin/python
	@echo "Setting up magcomp in $(VENV) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(VENV)/installed-dev: pyproject.toml | $(VENV)/bin/python
	@echo "Setting up magcomp and its test tools in $(VENV) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e '.[dev]'
	@touch $(VENV)/installed $@

# What every worker would compile for itself at the same time.
$(VENV)/collected: $(VENV)/installed-dev
	@$(BIN)/python -m pytest --collect-only -q > $@ || true

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
