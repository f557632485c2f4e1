# Everything a developer types. Each target sets up what it needs first: `make demo` works in a fresh clone.

VENV ?= .venv
BIN := $(VENV)/bin
PYTHON ?= python3
INSTALLED := $(VENV)/.installed

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help setup demo test test-all lint types layers scripts generated image-steps tool-install studies fuzz coverage browser pipewire test-pipewire vm test-vm vm-picture clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(INSTALLED) ## install Relit Camera and the development tools into .venv

$(INSTALLED): pyproject.toml scripts/setup.sh
	PYTHON=$(PYTHON) sh scripts/setup.sh $(VENV)
	@touch $@

demo: setup ## show the camera in a browser with a bundled person, until Ctrl-C; make demo DEMO="--seconds 20 --headless"
	$(BIN)/relit demo $(DEMO)

test: setup ## the checks and tests that the change needs, as CI runs them; make test PARTS="lint unit"
	$(BIN)/python -m tests.gate $(PREPARE) $(PARTS)

test-all: setup ## all of them, on Debian as root; notes what has passed in tests/gate/passed.json, to be committed
	$(BIN)/python -m tests.gate --all --record

lint: setup ## style and formatting
	$(BIN)/ruff check
	$(BIN)/ruff format --check

types: setup ## static types
	$(BIN)/mypy

layers: setup ## which part may import which
	$(BIN)/lint-imports --no-logo

generated: setup ## files that are built from code are what the code builds
	$(BIN)/python models/first_order_motion/build.py --check
	@mkdir -p build
	$(BIN)/python -m relit_camera.api.openapi.openapi_export build/openapi.json
	cmp docs/openapi.json build/openapi.json

scripts: setup ## shell scripts, Dockerfile and compose files
	$(BIN)/shellcheck scripts/*.sh docker/*.sh tests/browser/*.sh tests/pipewire/*.sh tests/vm/*.sh tests/vm/guest/*.sh .ci/run
	$(BIN)/hadolint docker/Dockerfile
	$(BIN)/check-jsonschema --builtin-schema vendor.compose-spec docker/compose*.yaml

image-steps: setup ## the image's build without Docker: a wheel, installed by itself, holds everything and works
	rm -rf build/image
	$(BIN)/virtualenv --quiet build/image
	sh docker/build-steps.sh build/image
	build/image/bin/python scripts/check_installed.py
	rm -rf build/image

tool-install: setup ## the wheel as users install it, used from an empty home; make tool-install WITH=pipx
	PYTHON=$(BIN)/python UV=$(abspath $(BIN))/uv sh scripts/check_tool_install.sh $(or $(WITH),uv)

studies: setup ## the long tests that `make test` leaves out
	$(BIN)/python -m pytest -m study tests

fuzz: setup ## mutated files on every reader, for an hour; make fuzz FUZZ="--seconds 60 --seed 3"
	$(BIN)/python -m tests.fuzz.fuzzing $(FUZZ)

coverage: setup ## the share of lines that tests execute: build/coverage/index.html
	PYTEST_ADDOPTS="--cov --cov-report=" $(BIN)/python -m tests.gate unit runs captures faults
	$(BIN)/python scripts/coverage_summary.py
	$(BIN)/coverage html --quiet --directory build/coverage

browser: ## Debian's Chromium, in which the panel is tested (root on Debian)
	sh tests/browser/install.sh

pipewire: ## PipeWire and its tools, unpacked into a folder, with which the camera in it is tested (Debian)
	sh tests/pipewire/install.sh

test-pipewire: setup pipewire ## the camera in a PipeWire session, of this machine's packages and of newer ones
	sh tests/pipewire/install.sh bookworm-backports
	PIPEWIRE_SUITES="own bookworm-backports" $(BIN)/python -m pytest tests/pipewire

vm: ## build the virtual machine in which the camera is tried on a real kernel (root on Debian 12, two minutes)
	sh tests/vm/build.sh

test-vm: setup vm ## the camera in that machine, with every version of v4l2loopback
	RELIT_VM_VERSIONS="0.12.7 0.13.2 0.15.0" $(BIN)/python -m pytest tests/vm

vm-picture: setup vm ## the call shown in docs/virtual-camera.md
	$(BIN)/python -m tests.vm.picture docs/pictures/call.jpg

clean: ## remove what the targets made, the virtual environment too
	rm -rf $(VENV) build dist test-failures .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .coverage .coverage.* $${XDG_CACHE_HOME:-$$HOME/.cache}/relit-camera-tests
