# Both targets do all their set-up: `make demo` runs the main job, `make test` checks everything.
PYTHON ?= python3
VENV := .venv
ifeq ($(OS),Windows_NT)
BIN := $(VENV)/Scripts
else
BIN := $(VENV)/bin
endif
STAMP := $(VENV)/.installed
# The kernels that are compiled at installation: one that changed is compiled again.
TYPES := $(wildcard planner/*/*_compiled.pxd planner/*/*/*_compiled.pxd)

# Every test that starts a process would compile the sources anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo docs test lint types faults ros2 benchmarks wheels clean

# The pip of Python 3.11 takes 40 s longer to choose versions than the one that constraints.txt names. pip would compile
# all packages one after another; what is imported is compiled then, by as many as import it.
$(STAMP): pyproject.toml setup.py constraints.txt $(TYPES) $(TYPES:_compiled.pxd=.py)
	$(PYTHON) -m venv $(VENV)
	PIP_CONSTRAINT="$(CURDIR)/constraints.txt" $(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	PIP_CONSTRAINT="$(CURDIR)/constraints.txt" $(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -e '.[test]'
	touch $(STAMP)

demo: $(STAMP)
	$(BIN)/stopgo demo -o recordings/demo

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)
	$(BIN)/pyrefly check

# Most tests of links wait for something, so eight files at a time are run even on two processors (tests/workers.py), in
# the order that tests/conftest.py deals them out. pyrefly checks types beside them and speaks last.
test: lint
	@$(BIN)/pyrefly check -j 1 >$(VENV)/types.txt 2>&1 & types=$$!; \
	$(BIN)/python -m pytest -p tests.workers --workers 8; tests=$$?; \
	wait $$types; typed=$$?; cat $(VENV)/types.txt; \
	[ $$tests -eq 0 ] && [ $$typed -eq 0 ]

# The long forms (docs/contributing.md): every test, with every sweep at full size, and every table of figures.
faults: $(STAMP)
	STOPGO_FAULTS=full $(BIN)/python -m pytest

# A real ROS 2 of wheels in .venv-ros2 (330 MB), and the tests that drive a mission with it.
ros2: $(STAMP)
	$(PYTHON) -m tests.ros2.environment
	$(BIN)/python -m pytest tests/ros2

benchmarks: $(STAMP)
	$(BIN)/python -m benchmarks

# Builds what is published, and installs it with each extra in an environment of its own.
wheels: $(STAMP)
	$(BIN)/python -m tests.wheels $(PYTHONS)

# The guides as a site, in build/site; a link that leads nowhere is an error.
docs: $(STAMP)
	PIP_CONSTRAINT="$(CURDIR)/constraints.txt" $(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check mkdocs-material
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

clean:
	rm -rf $(VENV) build dist *.egg-info recordings/demo .pytest_cache .ruff_cache
