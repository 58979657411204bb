# Everything on a fresh machine with Python 3.11+ and make.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
SCENE ?= four_bar_clearance
BENCH ?= all
# Bytecode is kept whatever the environment says: tests start hundreds of processes, and each would
# compile the package from its source, a second of CPU.
export PYTHONDONTWRITEBYTECODE =
# uv unpacks in a third of the time of pip, which takes over where only its own settings lead to an
# index; it believes the certificates of the system, as pip does. Modules are compiled when they are first imported: to compile all takes as long again.
PIP = $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
UV = UV_NATIVE_TLS=1 $(BIN)/uv pip install --quiet --python $(BIN)/python $(addprefix --default-index ,$(PIP_INDEX_URL))
BAG ?= runs/$(SCENE)-$(shell date +%Y%m%d-%H%M%S).mcap

.PHONY: run test test-all test-lowest lint bench docs evidence install clean
run: install
	@mkdir -p runs
	$(BIN)/mechanism-sim run $(SCENE) --revolutions 10 --processes --record $(BAG)
	$(BIN)/mechanism-sim bag info $(BAG)
	$(BIN)/mechanism-sim analyze $(BAG)

# A worker for each of two cores: each compiles for itself, so that more of them cost more.
test: install
	$(BIN)/pytest -n 2 --dist worksteal

test-all: install
	FUZZ_EXAMPLES=200 $(BIN)/pytest -n 2 --dist worksteal -m ''

# What pyproject.toml promises to run with: the lowest versions, in an environment of their own.
LOWEST = build/lowest
test-lowest:
	$(PYTHON) -m venv $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check uv
	$(LOWEST)/bin/uv pip compile --quiet --python $(LOWEST)/bin/python --upgrade \
	    --resolution lowest-direct --extra all --extra dev pyproject.toml \
	    --output-file $(LOWEST)/versions.txt
	$(LOWEST)/bin/uv pip install --quiet --python $(LOWEST)/bin/python \
	    --requirements $(LOWEST)/versions.txt --editable .
	$(LOWEST)/bin/python -m pytest -n 2 --dist worksteal

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache --no-logo

# The tables of docs/benchmarks.md: all of them in an hour of a quiet machine, or BENCH=torque_crank.
bench: install
	$(BIN)/python -m benchmarks $(BENCH) --output docs/pictures

docs: $(VENV)/installed-docs
	$(BIN)/python -m sphinx -W --keep-going -q -c docs . build/site
	$(BIN)/python docs/site/links.py build/site

# Screenshots of every kind of page, narrow and wide, light and dark, each looked at by axe-core.
evidence: docs
	MECHANISM_SIM_EVIDENCE=build/evidence $(BIN)/pytest -m '' test/pages/test_pages.py

install: $(VENV)/installed

$(VENV)/installed: pyproject.toml setup.py
	$(PYTHON) -m venv $(VENV)
	{ $(PIP) uv && $(UV) --editable '.[dev]'; } || $(PIP) --editable '.[dev]'
	@touch $@

$(VENV)/installed-docs: $(VENV)/installed
	{ $(PIP) uv && $(UV) --editable '.[docs]'; } || $(PIP) --editable '.[docs]'
	@touch $@

clean:
	rm -rf $(VENV) build *.egg-info
