# make demo, make test: each sets everything up on a fresh machine, and only once.

ifeq ($(OS),Windows_NT)
PYTHON ?= python
BIN := .venv/Scripts
else
PYTHON ?= python3
BIN := .venv/bin
endif

.PHONY: demo test long faults interop bench bench-model bench-devices bench-fit bench-images lint format clean

demo: .venv/installed
	$(BIN)/goniometer run recipes/iron_60deg.yaml --speed 20

test: .venv/installed
	$(BIN)/python -m pytest -n auto --dist worksteal

long: .venv/installed
	$(BIN)/python -m pytest -n auto --dist worksteal -m long

faults: .venv/installed
	$(BIN)/python benchmarks/fault_schedules 10000

interop: .venv/installed .venv-interop/installed
	$(BIN)/python -m pytest -m interop -rs tests/interop

bench: .venv/installed .venv-bench/installed
	$(BIN)/python benchmarks/scan.py
	$(BIN)/python benchmarks/effects.py
	$(BIN)/python benchmarks/beside_bluesky.py
	$(BIN)/python benchmarks/long_scan.py

bench-model: .venv/installed .venv-bench/installed
	$(BIN)/python benchmarks/model_cost.py --plot docs/model_cost.png

bench-devices: .venv/installed .venv-bench/installed
	$(BIN)/python benchmarks/round_trips.py

bench-fit: .venv/installed .venv-bench/installed
	$(subst .venv,.venv-bench,$(BIN))/python benchmarks/live_fit.py
	$(BIN)/python benchmarks/fits.py

bench-images: .venv-bench/installed
	$(subst .venv,.venv-bench,$(BIN))/python benchmarks/stokes_images.py

lint: .venv/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: .venv/installed
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

.venv/installed: pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "goniometer needs Python 3.11 or newer; try: make PYTHON=python3.12 " + "$(MAKECMDGOALS)")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@

.venv-bench/installed: benchmarks/requirements.txt
	$(PYTHON) -m venv .venv-bench
	$(subst .venv,.venv-bench,$(BIN))/python -m pip install --quiet --requirement $<
	touch $@

.venv-interop/installed: tests/interop/requirements.txt
	$(PYTHON) -m venv .venv-interop
	$(subst .venv,.venv-interop,$(BIN))/python -m pip install --quiet --requirement $<
	touch $@

clean:
	rm -rf .venv .venv-interop .venv-bench build *.egg-info
