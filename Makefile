# The project's commands; plain `make` lists them. Everything happens in .venv, build/ and out/.

.DEFAULT_GOAL := help
IS_USABLE = import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11 /usr/bin/python3; do \
  "$$p" -c '$(IS_USABLE)' 2>/dev/null && echo "$$p" && break; done)
BIN := .venv/bin
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
# Byte-compiling 200 MB of packages takes longer than installing them; only what every start imports is compiled (2 s), since
# where Python may not write its caches each start would do that again (half of one).
STARTED := numpy pxr OpenImageIO PyOpenColorIO typer pydantic pydantic_core rich typing_extensions.py
INSTALL := $(PIP) install --no-compile
# uv installs a lock in a fifth of pip's CPU seconds, from pip's own index; what it cannot, pip does.
INDEX = $$($(BIN)/python -m pip config list | sed -n "s/^[^ ]*[.]index-url='\(.*\)'$$/--default-index=\1/p" | tail -n 1)
install_lock = $(BIN)/uv pip install --quiet --python $(BIN)/python $(INDEX) -r $(1) || $(INSTALL) -r $(1)
# Tests start hundreds of processes: where Python may not write its caches, a server takes twice as long to start.
unexport PYTHONDONTWRITEBYTECODE
SITE = $$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("platlib"))')
CORE := $(shell find renderer/core -type f 2>/dev/null)
CORE_FORMATTED = $(filter %.cpp %.hpp %.h,$(CORE))
PYTHON_SOURCES := $(wildcard contrib docs/site examples renderer scenes service tests)
# The ISA classes that `make setup` compiles the core for: this CPU's newest, and the one that PRIMRAY_ISA asks for.
ISA := $(or $(PRIMRAY_ISA),own)
DEMO := sculpture
# What the demo's last line says: from the report (argument 1) how far the pixels shown are from the exact picture's.
SAID = import json, sys; error = json.load(open(sys.argv[1]))["error"]["display"]["estimate"]; \
  print(f"The picture: out/$(DEMO).png to look at, out/$(DEMO).exr scene-linear. By its own estimate its pixels differ from those of the " \
  f"exact picture by {error:.1f} of 255 (root mean square, as shown).\nYour own next, until that is 2:  $(BIN)/primray render " \
  "YOUR.usda -o picture.png --error-metric display --target-error 2")

.PHONY: help setup cores demo lint test test-all test-long debug check format stubs docs site bench render-assets wheel release clean

help:  ## list the commands
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) | awk -F'|' '{ printf "%-18s %s\n", $$1, $$2 }'

setup: .venv/.core-$(ISA)  ## make .venv and build for this CPU; .venv/bin/primray is there afterwards

cores: .venv/.core-all  ## build for the older ISA classes too, as a release and PRIMRAY_ISA=v2 ask

demo: setup  ## render a scene of the gallery to out/, as EXR and PNG, for 20 seconds
	@mkdir -p out
	$(BIN)/primray render scenes/gallery/$(DEMO)/scene.usda --res 640 360 --time-limit 20 -o out/$(DEMO).exr -o out/$(DEMO).png \
	  --report out/$(DEMO).json
	@$(BIN)/python -c '$(SAID)' out/$(DEMO).json

test: setup  ## run the tests of a change: units, translation, kernels, pictures, pages (some minutes)
	$(BIN)/python -m tests.run quick

test-all: setup  ## run all tests but the long ones, as .ci/run does: services, clusters, browsers, statistics too
	$(BIN)/python -m tests.run all

test-long: cores  ## run all tests, the long ones too, on every ISA class that this CPU runs
	$(BIN)/python -m pytest -m ""

# Python itself is not compiled for the sanitizers: their library and the one of C++, whose exceptions it intercepts, are loaded before
# it, and what Python keeps is no leak. Output is not captured, since a failed assertion ends the process.
SANITIZED = LD_PRELOAD="$$($(CXX) -print-file-name=libasan.so) $$($(CXX) -print-file-name=libstdc++.so)" \
  ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1 PRIMRAY_CORES=$(CURDIR)/build/debug PRIMRAY_ISA=v3

debug: setup  ## build the core with assertions and sanitizers, and run the tests of kernels and units on it (DEBUG=tests/...: those)
	$(BIN)/python renderer/core/build.py debug
	$(SANITIZED) $(BIN)/python -m pytest --capture=sys $(or $(DEBUG),tests/kernels tests/unit)

lint: setup  ## check format, lint and types
	$(BIN)/ruff format --check $(PYTHON_SOURCES)
	$(BIN)/ruff check $(PYTHON_SOURCES)
	@$(if $(CORE_FORMATTED),$(BIN)/clang-format --dry-run --Werror $(CORE_FORMATTED))
	$(BIN)/mypy

check: lint test-all  ## what must pass: format, lint, types, tests

format: setup  ## format Python and C++
	$(BIN)/ruff format $(PYTHON_SOURCES)
	$(BIN)/ruff check --fix-only $(PYTHON_SOURCES)
	$(if $(CORE_FORMATTED),$(BIN)/clang-format -i $(CORE_FORMATTED))

stubs: setup  ## write the types of the compiled core, after a change of its Python bindings
	$(BIN)/python renderer/core/stubs.py

docs: setup  ## bring generated pages, sources and parts of README.md up to date
	$(BIN)/python -m tests.docs.codes.diagnostics
	$(BIN)/python -m tests.docs.decisions
	$(BIN)/python -m tests.docs.flags.foreign
	$(BIN)/python -m tests.docs.measured.hard_cases
	$(BIN)/python -m tests.docs.measured.readme_figures
	$(BIN)/python -m tests.docs.settings
	$(BIN)/python -m tests.docs.openapi
	$(BIN)/python -m tests.docs.codes.fidelity
	$(BIN)/python -m tests.docs.conformance.page
	$(BIN)/python -m tests.docs.measured.light_accuracy
	$(BIN)/python -m tests.docs.measured.blender_table
	$(BIN)/python -m tests.docs.measured.benchmarks
	$(BIN)/python -m tests.docs.gallery.page

site: setup .venv/.site  ## build the site into build/site/html, its notebook run, its links checked
	$(BIN)/python docs/site/build.py

bench: setup  ## run the benchmarks of tests/bench (BENCH=--quick: small; PRIMRAY_PEERS=DIR: beside other renderers)
	$(BIN)/python -m tests.bench $(BENCH)

render-assets: setup  ## render every stage under ASSETS=DIR into a contact sheet, out/assets.html
	@test -d "$(ASSETS)" || { echo "make render-assets: ASSETS=DIR names the folder" >&2; exit 2; }
	@mkdir -p out
	$(BIN)/primray sheet "$(ASSETS)" -o out/assets.html

wheel: setup  ## build a wheel into dist/
	@rm -rf dist
	$(BIN)/python renderer/core/build.py wheel
	@ls dist/*.whl

release:  ## make a version, ready to be tagged: VERSION=x.y.z (.ci/release says what it checks)
	@VERSION="$(VERSION)" CHECKED="$(CHECKED)" $(PYTHON) .ci/release

clean:  ## remove everything that was made
	rm -rf .venv build dist out .mypy_cache .ruff_cache .pytest_cache
	find renderer service tests -name __pycache__ -type d -prune -exec rm -rf {} +

# The two halves of setup. Editable and without build isolation, so that a C++ change rebuilds only what it touches.
.venv/.locked: requirements-dev.lock
	@test -n "$(PYTHON)" || { echo "make: no Python 3.11 to 3.14 with the venv module found; install one (Debian: python3-venv)," \
	  "or name it: make PYTHON=/path/to/python3 ..." >&2; exit 1; }
	@"$(PYTHON)" -c '$(IS_USABLE)' 2>/dev/null || { echo "make: $(PYTHON) is no Python 3.11 to 3.14 with the venv module" >&2; exit 1; }
	$(PYTHON) -m venv --clear .venv
	@echo "installing packages into .venv (a minute or so) ..."
	@$(INSTALL) $$(sed -n 's/^\(uv==[^ ]*\).*/\1/p' requirements-dev.lock) || echo "going on without uv"
	@$(call install_lock,requirements-dev.lock)
	@touch $@

# One stamp for each ISA class that is there: an install has what it was asked for alone.
.venv/.core-%: .venv/.locked pyproject.toml renderer/primray/version.py $(CORE)
	@$(BIN)/python renderer/core/build.py install $*
	@cd "$(SITE)" && "$(CURDIR)/$(BIN)/python" -m compileall -q "$(CURDIR)/renderer/primray" "$(CURDIR)/service/primray_service" $(STARTED)
	@rm -f .venv/.core-*; touch .venv/.core-own $@ $$(ls "$(SITE)/primray" | sed -n 's/^_core_\(v.\)\..*/.venv\/.core-\1/p')

.venv/.site: requirements-site.lock .venv/.locked
	@$(call install_lock,requirements-site.lock)
	@touch $@
