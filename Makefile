# Each target sets up what it needs, in .venv. PYTHON is a Python of 3.11 to 3.13.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PLUGINS := $(wildcard plugins/*/pyproject.toml)
OUT ?= out/aqua-$(shell date +%Y%m%d-%H%M%S)
FRAMES ?= 12
START := $(shell date +%s)
# Runs a command and prints how long the target took, its set-up included: $(call timed,command)
timed = @$(1) || exit $$?; echo "make $@ took $$(( $$(date +%s) - $(START) )) s"

.PHONY: run test check bench clean

run: $(VENV)/ready
	$(call timed,$(BIN)/posse run aqua --renderer mitsuba --frames $(FRAMES) --out $(OUT))

test: $(VENV)/ready
	$(call timed,$(BIN)/python -m pytest -n 2 --dist loadfile)

check: $(VENV)/ready
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

bench: $(VENV)/ready
	$(call timed,$(BIN)/python benchmarks/stages.py)

# The plugins are installed after the core, which they depend on.
$(VENV)/ready: pyproject.toml $(PLUGINS)
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13) and "POSSE needs Python 3.11 to 3.13; name one by make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -qq --upgrade pip
	$(BIN)/python -m pip install -qq --editable '.[test]'
	$(BIN)/python -m pip install -qq $(foreach plugin,$(PLUGINS),--editable $(dir $(plugin)))
	touch $@

clean:
	rm -rf $(VENV) out build
