# The commands of this project. `make demo` and `make test` install everything they need into .venv.
SHELL := /bin/bash
PYTHON ?= python3
BIN := .venv/bin
export XDG_STATE_HOME ?= $(CURDIR)/.make/state

.PHONY: demo test check fix bench soak golden debian
.DEFAULT_GOAL := demo

demo: .make/demo-ready
	$(BIN)/dnc demo

test: .make/test-ready debian check
	$(BIN)/python -m pytest -n 2 --dist loadgroup -m "not soak" dnc planner sim tests

check: .make/test-ready
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

fix: .make/test-ready
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: .make/bench-ready
	$(BIN)/python -m benchmarks

soak: .make/test-ready
	$(BIN)/python -m pytest -m soak --timeout 7200 tests

golden: .make/test-ready
	DRIPMILL_GOLDEN=write $(BIN)/python -m pytest -q tests/golden

debian:
	bash .ci/debian

.make/venv:
	mkdir -p .make
	$(PYTHON) -m venv .venv
	touch $@

.make/demo-ready: .make/venv pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[plot,fast,web]'
	touch $@

.make/test-ready: .make/venv pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[plot,fast,web,dev]'
	touch $@ .make/demo-ready

.make/bench-ready: .make/test-ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[bench]'
	touch $@
