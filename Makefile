# Development targets; `make` without arguments lists them.
#
# Requirements: Python 3.11, 3.12 or 3.13, make and git.  The first target that needs packages
# creates the virtual environment .venv from requirements/dev.txt, which pins every file by its
# hash.  It is created again after a change of that file or of PYTHON.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SUFFIXES:
# The environment must exist before any other target; parallel targets would not save time.
.NOTPARALLEL:
SHELL := /bin/sh

VENV := .venv
BIN := $(VENV)/bin
OUT ?= out
UV ?= uv
IMAGE ?= motorid
# Without bytecode, each process that a test starts would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE
# Arguments for pytest or for a benchmark, such as ARGS="-k name -x".
ARGS ?=

# ---------------------------------------------------------------- environment

# Supported version with venv and ensurepip (separate packages in Debian).
USABLE := import ensurepip, sys, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))
VERSION := import sys; print(*sys.version_info[:3], sep=".")

PYTHON ?= $(shell for name in python3.13 python3.12 python3.11 python3; do \
	$$name -c '$(USABLE)' 2>/dev/null && { echo $$name; break; }; done)

INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-input
LOCKED := $(VENV)/.locked
READY := $(VENV)/.ready

# PYTHON, if given, must be the interpreter of the environment.
ifneq ($(filter command environment,$(origin PYTHON)),)
ifneq ($(wildcard $(LOCKED)),)
ifneq ($(shell $(PYTHON) -c '$(VERSION)' 2>/dev/null),$(shell $(BIN)/python -c '$(VERSION)'))
$(LOCKED): FORCE
endif
endif
endif

# Without compilation: Python compiles a module when it is first imported, and most never are.
$(LOCKED): requirements/dev.txt
	@test -n '$(PYTHON)' || { echo 'motorid: no usable Python found; install Python 3.11, 3.12 or' \
		'3.13 (on Debian with python3-venv), or give its path: make PYTHON=/path/to/python3' >&2; exit 2; }
	@$(PYTHON) -c '$(USABLE)' 2>/dev/null || { echo 'motorid: $(PYTHON) is not Python 3.11, 3.12' \
		'or 3.13 with the venv and ensurepip modules; give another one: make PYTHON=...' >&2; exit 2; }
	@echo 'Creating $(VENV) with $(PYTHON) from requirements/dev.txt (once; one to two minutes, 2 GB on disk)'
	@$(PYTHON) -m venv --clear $(VENV)
	@$(INSTALL) --no-compile --require-hashes --only-binary :all: --requirement requirements/dev.txt
	@touch $@

$(READY): $(LOCKED) pyproject.toml
	@$(INSTALL) --no-deps --no-build-isolation --editable .
	@touch $@

# Programs of `make peers`, which the project does not depend on.
PEERS := .venv-peers
$(PEERS)/.locked: requirements/peers.txt $(LOCKED)
	@echo 'Creating $(PEERS) from requirements/peers.txt (once; some minutes, 1.2 GB on disk)'
	@$(BIN)/python -m venv --clear $(PEERS)
	@$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check --no-input \
		--require-hashes --only-binary :all: --requirement requirements/peers.txt
	@touch $@

.PHONY: install
install: $(READY) ## create or update the virtual environment

.PHONY: lock
lock: ## resolve requirements/*.txt from pyproject.toml (needs uv); UPGRADE=1 selects new versions
	@sh requirements/lock.sh '$(UV)' $(if $(UPGRADE),--upgrade)

# ---------------------------------------------------------------- use

.PHONY: demo
demo: $(READY) ## identify a motor from the runs in data/ and print the path of the report
	@$(BIN)/motorid demo

.PHONY: serve
serve: $(READY) ## run the HTTP service on 127.0.0.1:8000 without API keys
	$(if $(wildcard $(OUT)/site/index.html),MOTORID_HELP_DIR=$(OUT)/site )$(BIN)/motorid serve --no-auth

.PHONY: data
data: $(READY) ## regenerate the campaigns in data/ with the bench simulator
	$(BIN)/python -m bench.make_data

# ---------------------------------------------------------------- checks

.PHONY: test
test: lint types imports spelling docstrings ## run all checks, then all tests (one process per core)
	$(BIN)/python -m pytest --numprocesses logical --dist loadfile --no-loadscope-reorder $(ARGS)

.PHONY: check
check: lint types imports spelling docstrings docs ## run the static checks and the documentation tests (less than a minute)

.PHONY: lint
lint: $(READY) ## check style and format with ruff
	$(BIN)/ruff check
	$(BIN)/ruff format --check

.PHONY: types
types: $(READY) ## check types with mypy (strict)
	$(BIN)/mypy --num-workers auto

.PHONY: imports
imports: $(READY) ## check the direction of imports with import-linter
	$(BIN)/lint-imports

.PHONY: spelling
spelling: $(READY) ## check spelling with codespell
	$(BIN)/codespell

.PHONY: docstrings
docstrings: $(READY) ## check with interrogate that each test has a docstring
	$(BIN)/interrogate tests

.PHONY: docs
docs: $(READY) ## check links, commands, decision records and generated pages against the code
	$(BIN)/python -m pytest --quiet tests/repository $(ARGS)

.PHONY: docs-site
docs-site: $(READY) ## build the documentation as a site in out/site; `make serve` shows it at /help/
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict --site-dir $(OUT)/site
	@echo '$(OUT)/site/index.html'

.PHONY: format
format: $(READY) ## format the code and sort the imports with ruff
	$(BIN)/ruff check --select I --fix
	$(BIN)/ruff format

# ---------------------------------------------------------------- measurements

.PHONY: bench
bench: $(READY) ## measure the speed relative to hand-written numba and scipy code
	$(BIN)/python -m benchmarks.speed

.PHONY: coverage
coverage: $(READY) ## measure the coverage of the 90 % intervals on simulated campaigns (long)
	$(BIN)/python -m benchmarks.coverage

.PHONY: calibration
calibration: $(READY) ## measure ranks, coverage and reliability on 400 simulated campaigns; ARGS="--campaigns 60" (long)
	OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.calibration $(ARGS)

.PHONY: same-results
same-results: $(READY) ## compare results with those of another version; ARGS="--against DIR" (long)
	$(BIN)/python -m benchmarks.same_results --out $(OUT)/results $(ARGS)

.PHONY: attribution
attribution: $(READY) ## measure the identification rate of hidden effects (long)
	$(BIN)/python -m benchmarks.attribution

.PHONY: peers
peers: $(READY) $(PEERS)/.locked ## compare with emcee on numba, NUTS, pyPESTO and PySINDy; ARGS="--only posterior" (long)
	$(BIN)/python -m benchmarks.peers --peers $(PEERS)/bin/python $(ARGS)

.PHONY: design-benchmark
design-benchmark: $(READY) ## measure how often a designed run separates tied effects; ARGS="--cases 60" (long)
	$(BIN)/python -m benchmarks.design $(ARGS)

.PHONY: benches
benches: $(READY) ## measure accuracy on realistic test bench recordings; ARGS="--first 0 --count 26" (long)
	$(BIN)/python -m benchmarks.benches $(ARGS)

.PHONY: faults
faults: $(READY) ## measure detection and false alarm rates of faulty runs (some minutes)
	$(BIN)/python -m benchmarks.faults

.PHONY: fleet-benchmark
fleet-benchmark: $(READY) ## measure false alarms and causes of drift, and coverage of pooling (some minutes)
	$(BIN)/python -m benchmarks.fleet $(ARGS)

.PHONY: report-page
report-page: $(READY) ## measure first paint, zoom and size of a report with long runs (needs chromium; some minutes)
	$(BIN)/python -m benchmarks.report_page --out docs/benchmarks/report-page.md $(ARGS)

.PHONY: torture
torture: $(READY) ## stress tests of the service: kills, bombs, fuzzing, load; ARGS=--short takes minutes (long)
	$(BIN)/python -m benchmarks.torture $(ARGS)

.PHONY: fuzz-fits
fuzz-fits: $(READY) ## fuzz the fit with absurd campaigns for internal errors; ARGS="--only SEED" (long)
	$(BIN)/python -m benchmarks.fuzz_fits $(ARGS)

.PHONY: audit
audit: $(READY) ## check the locked packages for known vulnerabilities with pip-audit; AUDIT=osv selects OSV
	$(BIN)/pip-audit --strict --no-deps --disable-pip --vulnerability-service $(or $(AUDIT),pypi) \
		--requirement requirements/run.txt

# ---------------------------------------------------------------- container

.PHONY: image
image: ## build the container image (needs docker, or ENGINE=podman)
	$(or $(ENGINE),docker) build --tag $(IMAGE) .

.PHONY: image-base
image-base: ## update the digest of the base image in the Dockerfile (needs docker with buildx)
	@tag=$$(sed -n 's/^ARG BASE=\([^@]*\)@.*/\1/p' Dockerfile) \
	&& digest=$$($(or $(ENGINE),docker) buildx imagetools inspect --format '{{.Manifest.Digest}}' "$$tag") \
	&& { echo "$$digest" | grep -qxE 'sha256:[0-9a-f]{64}' || { echo "motorid: $$tag has the digest" \
		"'$$digest'; expected sha256: and 64 hex digits; the Dockerfile is unchanged" >&2; exit 1; }; } \
	&& sed -i.bak "s|^ARG BASE=.*|ARG BASE=$$tag@$$digest|" Dockerfile && rm Dockerfile.bak \
	&& grep '^ARG BASE=' Dockerfile

.PHONY: container-check
container-check: $(READY) ## build and test the image without a container engine, as root; STANDIN=PREFIX (long)
	$(BIN)/python -m benchmarks.container $(if $(STANDIN),--python '$(STANDIN)')

# ----------------------------------------------------------------

.PHONY: clean
clean: ## remove the environment, the caches and the results
	rm -rf $(VENV) $(PEERS) $(OUT) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis \
		.import_linter_cache
	find app identification motorid bench benchmarks tests -name __pycache__ -type d -prune -exec rm -rf {} +

.PHONY: help
help: ## list the targets
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) \
		| awk -F '|' '{ printf "%-24s%s\n", $$1, $$2 }'

.PHONY: FORCE
FORCE:
