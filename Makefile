# Everything runs in .venv, which `make setup` builds from pinned versions: constraints.txt for
# Python 3.11 and 3.12, constraints-3.13.txt for later ones.

# The first interpreter that starts and is a supported version; `make PYTHON=… setup` overrides.
PYTHON ?= $(shell for p in python3.12 python3.11 python3.13 python3 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
CONSTRAINTS := $(shell $(PYTHON) -c 'import sys; \
	print("constraints.txt" if sys.version_info < (3, 13) else "constraints-3.13.txt")' 2>/dev/null)
BIN := .venv/bin
MINIMUM := .venv-minimum
# pip would compile all modules, one after the other, which takes as long as their installation:
# Python compiles those that are used.
INSTALL := PIP_CONSTRAINT=$(CONSTRAINTS) PIP_DISABLE_PIP_VERSION_CHECK=1 \
	$(BIN)/python -m pip install --quiet --no-compile
unexport PYTHONDONTWRITEBYTECODE
CHECK_PYTHON := @test -n "$(PYTHON)" || \
	{ echo "make: Python 3.11 or later is needed; name it with PYTHON=…" >&2; exit 2; }
ARGS ?=

.PHONY: setup run test lint coverage bench figures docs minimum dist clean

setup: .venv/kernels .venv/schemas

.venv/installed: pyproject.toml $(CONSTRAINTS)
	$(CHECK_PYTHON)
	@echo "make: installing the packages into .venv; this takes one to four minutes"
	$(PYTHON) -m venv .venv
	$(INSTALL) --editable '.[peers]'
	@touch $@

# The tests' packages, of which a run needs none. Of what is installed, pip adds an extra and builds
# nothing again.
.venv/installed-for-tests: .venv/installed
	@echo "make: installing the packages of the tests"
	$(INSTALL) 'stixel[test]'
	@touch $@

# Numba's kernels, compiled where they have changed. Without this, the first run compiles them.
.venv/kernels: .venv/installed $(shell grep -rl --include='*.py' 'import njit' stixel_cli)
	$(BIN)/python -m stixel_cli.machine.kernels
	@touch $@

# From the schema: docs/settings.md, and for editors the JSON Schemas that the first lines of the
# files of conf/ and pipelines/ name.
.venv/schemas: .venv/installed docs/settings.py $(shell find conf stixel_cli -name '*.yaml' -o -name '*.py')
	$(BIN)/stixel describe --schema conf/schema > /dev/null
	$(BIN)/python docs/settings.py
	@touch $@

# Without ARGS, two more trackers on the same scans follow, from the cache.
run: setup
	$(BIN)/stixel run $(ARGS)
ifeq ($(ARGS),)
	$(BIN)/stixel sweep tracker=contour,gp_ekf,point
	$(BIN)/stixel report --play "$$(ls -td results/sweep-tracker-*/ | head -n 1)"
endif
	@echo "open results/index.html in a browser: it links to the page of each run and sweep"

test: setup lint
	$(BIN)/python -m pytest -n 2 --dist worksteal -p no:benchmark $(ARGS)

lint: setup .venv/installed-for-tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# Which lines the tests run, the least covered modules first. It takes twice as long as the tests.
coverage: setup .venv/installed-for-tests
	$(INSTALL) 'stixel[coverage]'
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest -n 2 --dist worksteal -p no:benchmark $(ARGS)
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report --skip-covered --skip-empty

bench: setup .venv/installed-for-tests
	$(BIN)/python bench/write_page.py $(ARGS)

# Every number of a study and every picture in README and docs: two hours, 40 GB of cache. It starts
# the studies over, but what is in the cache is not computed again. With STIXEL_DATA=DIR also those of
# real data, see docs/studies.md; without, theirs stay as they are.
STUDIES := accuracy consistency robustness rq1 rq2 rq3 thesis
FIGURES := examples moving_picture gallery terminal metric_figure
ifdef STIXEL_DATA
STUDIES := motions robustness_real $(STUDIES)
FIGURES := home_away real_data away_figure $(FIGURES)
endif
figures: setup
	$(if $(STIXEL_DATA),$(INSTALL) 'stixel[argoverse]')
	set -e; for name in $(STUDIES); do $(BIN)/stixel study $$name --fresh cache.max_size=40GB; done
	$(BIN)/python docs/studies.py $(STUDIES:%=results/%)
	set -e; for name in $(FIGURES); do $(BIN)/python docs/$$name.py; done

# The site of the documentation, in build/site; a page that lacks a link or an entry is an error.
docs: setup
	$(INSTALL) 'stixel[docs]'
	$(BIN)/python -m sphinx -c docs/site -b html -q -W --keep-going -E . build/site
	cp build/site/README.html build/site/index.html
	@echo "open build/site/index.html in a browser"

# The lowest declared version of every dependency, in a venv of its own: one fabricated and one
# rendered run, computed anew.
minimum:
	$(CHECK_PYTHON)
	$(PYTHON) -m venv --clear $(MINIMUM)
	$(PYTHON) tests/minimum_versions.py > $(MINIMUM)/requirements.txt
	$(MINIMUM)/bin/python -m pip --disable-pip-version-check install --quiet \
		--requirement $(MINIMUM)/requirements.txt .
	$(MINIMUM)/bin/stixel run --help > /dev/null
	STIXEL_CACHE=$(MINIMUM)/cache $(MINIMUM)/bin/stixel run --results $(MINIMUM)/results \
		measurement=fabricated path.duration=2
	STIXEL_CACHE=$(MINIMUM)/cache $(MINIMUM)/bin/stixel run --results $(MINIMUM)/results \
		path.duration=0.3 rig.width=160 rig.height=120 'pictures.frames=[1]'

# The source archive, and the wheel built from it, in dist; checked for an index of packages.
dist: setup
	PIP_CONSTRAINT=$(CONSTRAINTS) $(BIN)/python -m pip install --quiet build twine
	rm -rf dist
	$(BIN)/python -m build
	$(BIN)/python -m twine check --strict dist/*

clean:
	rm -rf .venv $(MINIMUM) .coverage* build dist .pytest_cache .ruff_cache .hypothesis
