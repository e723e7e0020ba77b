# make run     set up, judge the built-in renderers, by playback, in closed loop and recorded, write results/
# make test    set up with the development tools, run the tests; LATEST=1, here or elsewhere: with the newest libraries of today, in
#              .venv-latest, rather than with those of constraints.txt
# make lock    write the newest libraries that pyproject.toml allows into constraints.txt, for every platform
# make system  run the tests that start commands and clusters, kill them, and judge whole suites, and what takes seconds
# make fuzz    explore with fresh seeds: the ideal contact in EXAMPLES=300, then for MINUTES=30 properties, damaged files,
#              odd renderers
# make mutants  change the checks, and what judges by them, in one operator or number at a time and see whether a test fails: hours,
#              or SAMPLE=60 of them by SEED=1
# make tables  write anew what tests compare: kill matrix, coverage, decisions, and the recorded verdicts of every suite,
#              or of one check with CHECK=drift
# make measures  compare what checks measure with what stands in tests/meta/measured.csv: for who reviews a change of them
# make counterexamples  search for the smallest path that breaks each built-in renderer, into results/counterexamples
# make engines judge physics engines as renderers and write docs/engines.md, or of SUITES="solids seams" only
# make engines-smallest  shrink what fails there to the smallest path, for that page
# make field   judge the renderers of other publications beside the thesis's, and write their page's tables
# make bench   time the renderers            make study   the longer studies
# make browser look at the report's pages in a headless Chromium: needs chromium and npm
# make docs    run the pages of documentation and the notebooks, and build the site of them into build/site
# make pictures  the same, and take the pictures that the pages link into docs/pictures
# make site    the pages with the report of the built-in renderers in it
# make lint    ruff, and mypy on an installed copy
# make clean   remove what these made; results/ stays

PYTHON ?= python3
VENV := .venv$(if $(LATEST),-latest)
BIN := $(VENV)/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Tests start many interpreters, each of which would compile every module anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run test lock system tables measures fuzz mutants counterexamples engines engines-smallest field bench study browser docs pictures site lint clean

# What accuracy costs in time, and five seconds of the simulated robot replayed, stand on the report's first page, which links what
# the thesis shows. What goes wrong with these three says so, and stops nothing.
run: $(VENV)/run.stamp
	@$(BIN)/hapticeval bench --quick -o results || true
	@rm -rf results/robot.h5 results/replay
	@$(BIN)/hapticeval record --model cassinian --seconds 5 -o results/robot.h5 || true
	@$(BIN)/hapticeval replay results/robot.h5 -r minimum-distance -r constraint -r conformal -o results/replay || true
	@$(BIN)/hapticeval reproduce all -o results/thesis > /dev/null || \
	  echo "something of the thesis differs for no reason that is given: see results/thesis/index.html" >&2
	@$(BIN)/hapticeval run thesis dynamics generated effects hard-cases solids moving experiments -o results || { code=$$?; \
	  echo "hapticeval ended with exit code $$code, see 'Exit codes' in the README; what was written is in results/" >&2; \
	  exit $$code; }

lock: $(VENV)/dev.stamp
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --upgrade --all-extras --no-annotate --custom-compile-command 'make lock' \
	  pyproject.toml --output-file constraints.txt

test: $(VENV)/dev.stamp
	$(BIN)/pytest -n 2 --dist worksteal

system: $(VENV)/dev.stamp
	$(BIN)/pytest -n 2 --dist worksteal -m 'system and not slow'
	$(BIN)/pytest benchmarks/ --benchmark-disable

# Cells that say the same stay as they are, to the digit. In one process: each table is one file. With CHECK=ID only what asks
# that check is judged, of that check alone, and of the texts of errors only those that list checks. Nothing selected is no error (5):
# a check may have no test of its own yet.
tables: $(VENV)/dev.stamp
	HAPTICEVAL_PUBLISH=$(or $(CHECK),1) $(BIN)/pytest -q -m '' -k 'recorded or published or page_counts or page_is_the_table' \
	  tests/phenomena/test_decisions.py tests/test_listed.py tests/meta/test_kill_matrix.py tests/suites
	HAPTICEVAL_PUBLISH=$(or $(CHECK),1) $(BIN)/pytest -q $(if $(CHECK),--measures $(CHECK)) tests/phenomena tests/meta \
	  tests/recordings/test_drawn.py || [ $$? = 5 ]
	HAPTICEVAL_PUBLISH=$(or $(CHECK),1) $(BIN)/pytest -q -m 'refusals and not slow' $(if $(CHECK),tests/suite tests/runner)

measures: $(VENV)/dev.stamp
	HAPTICEVAL_MEASURES=1 $(BIN)/pytest -n 2 --dist worksteal -m 'not slow' tests/phenomena tests/meta tests/suites

fuzz: $(VENV)/dev.stamp
	$(BIN)/python tests/fuzz.py ideal $$(date +%s) $(or $(EXAMPLES),300)
	$(BIN)/python tests/fuzz.py $(or $(MINUTES),30)

mutants: $(VENV)/dev.stamp
	$(BIN)/python tests/mutate.py $(if $(SAMPLE),--sample $(SAMPLE)) --seed $(or $(SEED),0) $(TARGETS)

# What is kept is tried first the next time, and stays as it is while it fails. A minute for each renderer at the most.
counterexamples: $(VENV)/run.stamp
	@$(BIN)/hapticeval search -r constraint -r conformal -r mapping -r minimum-distance -r set-stabilisation \
	  --check continuous-contact --check broken-contact --check abrupt-switch --check impulsive-collision \
	  --check memoryless -o results/counterexamples || [ $$? = 1 ]

engines: $(VENV)/dev.stamp
	$(BIN)/python -m hapticeval.examples.engines.measure $(SUITES)

field: $(VENV)/dev.stamp
	$(BIN)/python -m hapticeval.examples.studies.field_tables

# From what make engines has left in results/engines.
engines-smallest: $(VENV)/dev.stamp
	$(BIN)/python -m hapticeval.examples.engines.smallest

bench: $(VENV)/dev.stamp
	$(BIN)/pytest benchmarks/ -m ''

study: $(VENV)/dev.stamp
	$(BIN)/pytest -n 2 --dist worksteal -m slow

browser: $(VENV)/dev.stamp $(VENV)/browser/node_modules/axe-core/axe.min.js
	$(BIN)/pytest -m browser

docs: $(VENV)/dev.stamp
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/pytest -n 2 -m docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# What the pages link, as it is drawn now.
pictures: docs
	cp $$(grep -oh 'pictures/[a-z0-9.-]*\.svg' docs/*.md | sort -u | sed 's,^,build/site/,') docs/pictures/

site: run docs

lint: $(VENV)/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	rm -rf build
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --target build/typecheck .
	cd build/typecheck && ../../$(BIN)/mypy --config-file ../../pyproject.toml --cache-dir ../../.mypy_cache -p hapticeval

# The install is editable: changes to the code need no new one. A change of pyproject.toml or of constraints.txt does.
$(VENV)/run.stamp: pyproject.toml constraints.txt | $(VENV)/bin/pip
	@echo "installing hapticeval and the libraries that it needs into $(VENV)" >&2
	$(call install,.)
	@touch $@

$(VENV)/dev.stamp: pyproject.toml constraints.txt | $(VENV)/bin/pip
	@echo "installing hapticeval, its libraries and the development tools into $(VENV)" >&2
	$(call install,'.[dev]')
	@touch $@ $(VENV)/run.stamp

# uv installs in a tenth of pip's processor time, but reads no settings of pip: where these name an index, or where uv cannot be had or
# fails, pip installs. What builds the package lies in the environment, and so is of a known version too.
define install
@if $(BIN)/pip config list | grep -q '[.]index-url' || ! $(BIN)/pip install --quiet $(VERSIONS) 'setuptools>=77' uv || \
  ! $(BIN)/uv pip install --quiet --python $(BIN)/python $(VERSIONS) --no-build-isolation --editable $(1); then \
  $(BIN)/pip install --quiet $(VERSIONS) 'setuptools>=77' && \
  $(BIN)/pip install --quiet $(VERSIONS) --no-build-isolation --editable $(1); fi
endef

ifdef LATEST
VERSIONS := --upgrade
export PIP_UPGRADE_STRATEGY := eager
.PHONY: $(VENV)/run.stamp $(VENV)/dev.stamp # tomorrow's newest is another
else
VERSIONS := --constraint constraints.txt
endif

# What judges whether the pages can be read by everyone.
$(VENV)/browser/node_modules/axe-core/axe.min.js: | $(VENV)/bin/pip
	npm install --silent --no-fund --no-audit --no-save --prefix $(VENV)/browser axe-core@4

$(VENV)/bin/pip:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "hapticeval needs Python 3.11 or later, and $(PYTHON) is $$($(PYTHON) --version 2>&1)." >&2; \
	  echo "Name a later one: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 1; }
	@echo "making a virtual environment in $(VENV)" >&2
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

clean:
	rm -rf .venv .venv-latest build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
