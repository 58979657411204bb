# Everything on a fresh machine with Python 3.11+ and make.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
SCENE ?= four_bar_clearance
BAG ?= runs/$(SCENE)-$(shell date +%Y%m%d-%H%M%S).mcap

.PHONY: run test lint install clean
run: install
	@mkdir -p runs
	$(BIN)/mechanism-sim run $(SCENE) --revolutions 10 --processes --record $(BAG)
	$(BIN)/mechanism-sim info $(BAG)
	$(BIN)/mechanism-sim analyze $(BAG)

test: install
	$(BIN)/pytest -n 2 --dist worksteal

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

install: $(VENV)/installed

$(VENV)/installed: pyproject.toml setup.py
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) build *.egg-info
