# Everything is done through these targets; `make` alone lists them.
#
# A machine needs Python 3.11, 3.12 or 3.13, make and git.  The first target that needs packages
# makes the virtual environment .venv from requirements/dev.txt, where each file is named by its
# hash, and makes it again when that file changes or when another PYTHON is asked for.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SUFFIXES:
# The environment must exist before anything runs; nothing here gains from running side by side.
.NOTPARALLEL:
SHELL := /bin/sh

VENV := .venv
BIN := $(VENV)/bin
OUT ?= out
UV ?= uv
IMAGE ?= motorid
# As many tests at once as cores; one stops at the first warning that nobody explained.  ARGS="-k name -x" passes words to pytest.
ARGS ?=

# ---------------------------------------------------------------- environment

# In range, and able to make an environment with pip in it (Debian ships that part separately).
USABLE := import ensurepip, sys, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))
VERSION := import sys; print(*sys.version_info[:3], sep=".")

PYTHON ?= $(shell for name in python3.13 python3.12 python3.11 python3; do \
	$$name -c '$(USABLE)' 2>/dev/null && { echo $$name; break; }; done)

INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-input
LOCKED := $(VENV)/.locked
READY := $(VENV)/.ready

# An interpreter that was named must be the one in the environment.
ifneq ($(filter command environment,$(origin PYTHON)),)
ifneq ($(wildcard $(LOCKED)),)
ifneq ($(shell $(PYTHON) -c '$(VERSION)' 2>/dev/null),$(shell $(BIN)/python -c '$(VERSION)'))
$(LOCKED): FORCE
endif
endif
endif

$(LOCKED): requirements/dev.txt
	@test -n '$(PYTHON)' || { echo 'motorid: no usable Python found; install Python 3.11, 3.12 or' \
		'3.13 (on Debian with python3-venv), or name one: make PYTHON=/path/to/python3' >&2; exit 2; }
	@$(PYTHON) -c '$(USABLE)' 2>/dev/null || { echo 'motorid: $(PYTHON) is not Python 3.11, 3.12' \
		'or 3.13 with the venv and ensurepip modules; name another: make PYTHON=...' >&2; exit 2; }
	@echo 'Making $(VENV) with $(PYTHON) from requirements/dev.txt (once; a minute or two, 1 GB on disk)'
	@$(PYTHON) -m venv --clear $(VENV)
	@$(INSTALL) --require-hashes --only-binary :all: --requirement requirements/dev.txt
	@touch $@

$(READY): $(LOCKED) pyproject.toml
	@$(INSTALL) --no-deps --no-build-isolation --editable .
	@touch $@

.PHONY: install
install: $(READY) ## make the virtual environment, if it is not there or out of date

.PHONY: lock
lock: ## resolve requirements/*.txt from pyproject.toml anew (needs uv); UPGRADE=1 takes new versions
	@sh requirements/lock.sh '$(UV)' $(if $(UPGRADE),--upgrade)

# ---------------------------------------------------------------- use

.PHONY: demo
demo: $(READY) ## identify a motor from the runs in data/ and print where the report is
	@$(BIN)/motorid demo

.PHONY: serve
serve: $(READY) ## the HTTP service on 127.0.0.1:8000, without keys
	$(BIN)/motorid serve --no-auth

.PHONY: data
data: $(READY) ## make the campaigns in data/ again with the bench simulator
	$(BIN)/python -m bench.make_data

# ---------------------------------------------------------------- checks

.PHONY: test
test: lint types imports spelling docstrings ## all checks, then all tests
	$(BIN)/python -m pytest --numprocesses logical --dist loadfile $(ARGS)

.PHONY: check
check: lint types imports spelling docstrings docs ## what needs no test to run: a minute at most

.PHONY: lint
lint: $(READY) ## ruff: rules and format
	$(BIN)/ruff check
	$(BIN)/ruff format --check

.PHONY: types
types: $(READY) ## mypy, strict
	$(BIN)/mypy

.PHONY: imports
imports: $(READY) ## import-linter: the direction of imports
	$(BIN)/lint-imports

.PHONY: spelling
spelling: $(READY) ## codespell
	$(BIN)/codespell

.PHONY: docstrings
docstrings: $(READY) ## interrogate: each test says where its expected number comes from
	$(BIN)/interrogate tests

.PHONY: docs
docs: $(READY) ## links, commands, decision records and generated pages agree with the code
	$(BIN)/python -m pytest --quiet tests/repository $(ARGS)

.PHONY: format
format: $(READY) ## let ruff format the code and sort the imports
	$(BIN)/ruff check --select I --fix
	$(BIN)/ruff format

# ---------------------------------------------------------------- measurements

.PHONY: bench
bench: $(READY) ## speed beside hand-written scipy and numba code of the same model
	$(BIN)/python -m benchmarks.speed

.PHONY: coverage
coverage: $(READY) ## do 90 % intervals cover in 90 % of simulated campaigns? (long)
	$(BIN)/python -m benchmarks.coverage

.PHONY: attribution
attribution: $(READY) ## are hidden effects named? (long)
	$(BIN)/python -m benchmarks.attribution

.PHONY: benches
benches: $(READY) ## motors from runs as benches record them; ARGS="--first 0 --count 26" (long)
	$(BIN)/python -m benchmarks.benches $(ARGS)

.PHONY: faults
faults: $(READY) ## are faulty runs refused, and sound ones never? (some minutes)
	$(BIN)/python -m benchmarks.faults

.PHONY: torture
torture: $(READY) ## the service under kills, bombs, fuzz and load; ARGS=--short for minutes (long)
	$(BIN)/python -m benchmarks.torture $(ARGS)

.PHONY: fuzz-fits
fuzz-fits: $(READY) ## absurd campaigns, none may end in an internal error; ARGS="--only SEED" (long)
	$(BIN)/python -m benchmarks.fuzz_fits $(ARGS)

.PHONY: audit
audit: $(READY) ## known weaknesses of the locked packages, by pip-audit; AUDIT=osv asks another service
	$(BIN)/pip-audit --strict --no-deps --disable-pip --vulnerability-service $(or $(AUDIT),pypi) \
		--requirement requirements/run.txt

# ---------------------------------------------------------------- container

.PHONY: image
image: ## build the container image (needs docker, or ENGINE=podman)
	$(or $(ENGINE),docker) build --tag $(IMAGE) .

.PHONY: image-base
image-base: ## name the newest base image of the same tag in the Dockerfile (needs docker with buildx)
	@tag=$$(sed -n 's/^ARG BASE=\([^@]*\)@.*/\1/p' Dockerfile) \
	&& digest=$$($(or $(ENGINE),docker) buildx imagetools inspect --format '{{.Manifest.Digest}}' "$$tag") \
	&& { echo "$$digest" | grep -qxE 'sha256:[0-9a-f]{64}' || { echo "motorid: $$tag has the digest" \
		"'$$digest'; expected sha256 and 64 figures; the Dockerfile is as it was" >&2; exit 1; }; } \
	&& sed -i.bak "s|^ARG BASE=.*|ARG BASE=$$tag@$$digest|" Dockerfile && rm Dockerfile.bak \
	&& grep '^ARG BASE=' Dockerfile

.PHONY: container-check
container-check: $(READY) ## build and run the image without an engine, as root; STANDIN=PREFIX (long)
	$(BIN)/python -m benchmarks.container $(if $(STANDIN),--python '$(STANDIN)')

# ----------------------------------------------------------------

.PHONY: clean
clean: ## remove the environment, caches and results
	rm -rf $(VENV) $(OUT) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis \
		.import_linter_cache
	find app identification motorid bench benchmarks tests -name __pycache__ -type d -prune -exec rm -rf {} +

.PHONY: help
help: ## this list
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) \
		| awk -F '|' '{ printf "%-20s %s\n", $$1, $$2 }'

.PHONY: FORCE
FORCE:
