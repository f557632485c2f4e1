# Everything a developer types. Each target sets up what it needs first: `make demo` works in a fresh clone.

VENV ?= .venv
BIN := $(VENV)/bin
PYTHON ?= python3
INSTALLED := $(VENV)/.installed
PROCESSES ?= $(shell expr $$(nproc 2>/dev/null || echo 2) + 1)
# Tests that take both cores, and the measurement of what a picture costs, which tells nothing beside others.
BY_THEMSELVES := tests/vm tests/browser tests/pipewire tests/lab/bench/test_recorded_cost.py
TOGETHER := -n $(PROCESSES) --dist loadgroup --no-loadscope-reorder $(BY_THEMSELVES:%=--ignore=%)

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help setup demo test check lint types layers scripts generated image-steps tool-install pytest studies fuzz coverage browser test-browser pipewire test-pipewire vm test-vm vm-picture clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(INSTALLED) ## install Relit Camera and the development tools into .venv

$(INSTALLED): pyproject.toml scripts/setup.sh
	PYTHON=$(PYTHON) sh scripts/setup.sh $(VENV)
	@touch $@

demo: setup ## show the camera in a browser with a bundled person, until Ctrl-C; make demo DEMO="--seconds 20 --headless"
	$(BIN)/relit demo $(DEMO)

test: check ## all checks and tests, as CI runs them

check: lint types layers scripts generated image-steps pytest ## the same

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
	PYTHON=$(BIN)/python sh scripts/check_tool_install.sh $(or $(WITH),uv)

# What is compiled once need not be by each of the hundreds of processes that tests start.
pytest: export PYTHONDONTWRITEBYTECODE =
pytest: setup ## the tests alone, in one process more than there are cores; make pytest PROCESSES=4
	rm -f build/durations.json
	TEST_PART=together $(BIN)/python -m pytest $(TOGETHER)
	TEST_PART=cost $(BIN)/python -m pytest tests/lab/bench/test_recorded_cost.py
	# Browser and emulated machine would leave no core to tests that hold in real time.
	# Of the browser's tests each may run in any process: those of a file take up to four minutes.
	TEST_PART=pipewire $(BIN)/python -m pytest tests/pipewire
	TEST_PART=browser $(BIN)/python -m pytest -n 2 --dist worksteal tests/browser
	TEST_PART=vm $(BIN)/python -m pytest tests/vm
	$(BIN)/python -m tests.durations

studies: setup ## the long tests that `make test` leaves out
	$(BIN)/python -m pytest -m study tests

fuzz: setup ## mutated files on every reader, for an hour; make fuzz FUZZ="--seconds 60 --seed 3"
	$(BIN)/python -m tests.fuzz.fuzzing $(FUZZ)

coverage: setup ## the first of these with the share of lines that they execute: build/coverage/index.html
	$(BIN)/python -m pytest $(TOGETHER) --cov --cov-report=
	$(BIN)/python scripts/coverage_summary.py
	$(BIN)/coverage html --quiet --directory build/coverage

browser: ## Debian's Chromium, in which the panel is tested (root on Debian)
	sh tests/browser/install.sh

test-browser: setup ## the panel in a real browser
	$(BIN)/python -m pytest tests/browser

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
	rm -rf $(VENV) build dist test-failures .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .coverage .coverage.*
