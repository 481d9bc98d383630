# make demo: a vehicle with known angles, scanned, measured, beside its truth.
# make test: all tests. Both make .venv first, from the locked versions.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
LOCK := .ci/requirements.lock

.PHONY: demo test check bench fuzz lock clean

demo: $(VENV)/ready
	$(BIN)/wheelplane demo demo-output

test: $(VENV)/ready
	$(BIN)/python -m pytest -n 2

check: $(VENV)/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/ready
	$(BIN)/python tests/bench/accuracy.py
	$(BIN)/python tests/bench/speed.py
	$(BIN)/python tests/bench/reading.py
	$(BIN)/python tests/bench/segmentation.py
	$(BIN)/python tests/bench/detection.py
	$(BIN)/python tests/bench/shapes.py

fuzz: $(VENV)/ready
	$(BIN)/python tests/bench/fuzz.py --mutants 20000 --seed 0

$(VENV)/ready: pyproject.toml $(LOCK)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or later is needed; name it: make PYTHON=python3.11 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $(LOCK)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

# Pins every dependency, for all systems and Pythons that pyproject.toml allows. Needs uv.
lock:
	uv pip compile --universal --extra dev --generate-hashes --no-header --upgrade -q \
		pyproject.toml -o $(LOCK)

clean:
	rm -rf $(VENV) demo-output
