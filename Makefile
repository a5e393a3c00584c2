# Each target sets up what it needs. PYTHON is a Python of 3.11 to 3.13.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
BLENDER_VENV := .venv-blender
DIST_VENV := .venv-dist
PLUGINS := $(wildcard plugins/*/pyproject.toml examples/*/pyproject.toml)
OUT ?= out/aqua-$(shell date +%Y%m%d-%H%M%S)
FRAMES ?= 12
START := $(shell date +%s)
# $(call timed,command) runs a command and prints how long the target took, with its set-up.
timed = @$(1) || exit $$?; echo "make $@ took $$(( $$(date +%s) - $(START) )) s"

.PHONY: run test check bench docs dist clean

run: $(VENV)/ready
	$(call timed,$(BIN)/posse run aqua --renderer mitsuba --frames $(FRAMES) --out $(OUT))

# Files are taken in their order: ordered by the number of tests, those of few long ones would be the last,
# and one process would wait for them.
TESTING := -n 2 --dist loadfile --no-loadscope-reorder
test: $(VENV)/ready-to-test $(BLENDER_VENV)/ready
	$(call timed,POSSE_BLENDER_PYTHON=$(abspath $(BLENDER_VENV)/bin/python) $(BIN)/python -m pytest $(TESTING))

check: $(VENV)/ready-to-test
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	MYPYPATH=tests/support $(BIN)/mypy benchmarks/*.py

bench: $(VENV)/ready
	$(call timed,$(BIN)/python benchmarks/stages.py)

# The site of the documentation, in docs/_build/html; a warning is an error.
docs: $(VENV)/ready-to-test
	$(call timed,$(BIN)/python -m sphinx -W --keep-going -q docs docs/_build/html)

# Wheels and sdists of all distributions in dist/; the wheels are tried alone in a new environment of each
# Python in PYTHONS.
PYTHONS ?= $(PYTHON)
dist: $(DIST_VENV)/ready
	$(call timed,$(DIST_VENV)/bin/python packaging/try_dist.py dist $(PYTHONS))

$(DIST_VENV)/ready:
	$(PYTHON) -m venv $(DIST_VENV)
	$(DIST_VENV)/bin/python -m pip install -qq 'build>=1.2' 'setuptools>=77' 'twine>=6'
	touch $@

$(VENV)/ready: pyproject.toml plugins/render_mitsuba/pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13) and "POSSE needs Python 3.11 to 3.13; name one by make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -qq --upgrade pip
	$(BIN)/python -m pip install -qq --editable .
	$(BIN)/python -m pip install -qq --editable plugins/render_mitsuba
	touch $@

# The plugins are installed after the core, which they depend on. TORCH names a version because pip would take
# the newest, which on Linux is a build for CUDA of several GB; any version from 2.9 on works.
TORCH ?= torch==2.13.0
$(VENV)/ready-to-test: $(VENV)/ready $(PLUGINS)
	$(BIN)/python -m pip install -qq --editable '.[test,docs]'
	$(BIN)/python -m pip install -qq '$(TORCH)'
	$(BIN)/python -m pip install -qq $(foreach plugin,$(PLUGINS),--editable $(dir $(plugin)))
	touch $@

# Blender needs its own environment, because bpy pins the versions of Python and numpy. If pip finds no bpy, the
# Blender plugin's tests report that they were skipped.
$(BLENDER_VENV)/ready:
	$(PYTHON) -m venv $(BLENDER_VENV)
	-$(BLENDER_VENV)/bin/python -m pip install -qq 'bpy==5.0.1' 'numpy<2'
	touch $@

clean:
	rm -rf $(VENV) $(BLENDER_VENV) $(DIST_VENV) out build dist docs/_build docs/generated
