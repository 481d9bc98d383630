# Everything runs in .venv, made from the locked versions by the first target that needs it.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
LOCK := .ci/requirements.lock
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
UV := $(BIN)/uv pip install --quiet --python $(BIN)/python
# The tests start hundreds of processes, each of which would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-all smoke check docs bench bench-quick fuzz lock sbom audit clean help

demo: $(VENV)/ready  ## a synthetic vehicle, scanned, measured, beside its true angles
	$(BIN)/wheelplane demo demo-output

test: $(VENV)/ready  ## the tests, but for those marked slow
	$(BIN)/python -m pytest -n 3 --dist loadfile -m "not slow" --share "$(or $(SHARE),0/1)" --cases "$(or $(CASES),0/1)"

test-all: $(VENV)/ready  ## all tests; CI runs a sixtieth of the slow ones for each commit
	$(BIN)/python -m pytest -n 2

smoke: $(VENV)/ready  ## the demo and the tests of files and batches, for another Python: PYTHON=, VENV=
	$(BIN)/wheelplane demo $(VENV)/demo
	$(BIN)/python -m pytest -n 2 -m "not slow" --share "$(or $(SHARE),0/1)" tests/readers/test_readers.py tests/readers/test_packed.py \
		tests/readers/test_e57.py tests/capture tests/batch/test_batch.py

check: $(VENV)/ready  ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(VENV)/docs  ## manual, reference of the library and notebooks as one site: site/index.html
	NO_MKDOCS_2_WARNING=1 PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/mkdocs build --quiet --strict --config-file .ci/docs/mkdocs.yml

bench: $(VENV)/ready  ## the README's figures of accuracy and speed
	$(BIN)/python -m tests.bench.accuracy
	$(BIN)/python -m tests.bench.speed
	$(BIN)/python -m tests.bench.reading
	$(BIN)/python -m tests.bench.segmentation
	$(BIN)/python -m tests.bench.detection
	$(BIN)/python -m tests.bench.shapes

bench-quick: $(VENV)/ready  ## where users wait, as ratios within one run (3 minutes)
	$(BIN)/python -m tests.bench.quick

fuzz: $(VENV)/ready  ## 20,000 damaged files through every reader
	$(BIN)/python -m tests.bench.fuzz --mutants 20000 --seed 0

$(VENV)/ready: pyproject.toml $(LOCK) pipeline/cloud/kernels.c .ci/build_kernels.py
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or later is needed; name it: make PYTHON=python3.11 $(MAKECMDGOALS)"; exit 1; }
	@mkdir -p .ci/editable
	@[ -e .ci/editable/wheelplane ] || ln -s ../../pipeline .ci/editable/wheelplane
	@[ -e .ci/editable/wheelplane_synth ] || ln -s ../../synth .ci/editable/wheelplane_synth
	$(PYTHON) -m venv $(VENV)
	awk '/^[a-z]/ { on = /^uv==/ } on' $(LOCK) | $(PIP) --require-hashes -r /dev/stdin
	$(UV) --require-hashes -r $(LOCK) || $(PIP) --require-hashes -r $(LOCK)
	$(PIP) --no-deps --no-build-isolation -e .
	@touch $@

$(VENV)/docs: .ci/docs/requirements.lock $(VENV)/ready
	$(UV) --require-hashes -r $< || $(PIP) --require-hashes -r $<
	@touch $@

lock: $(VENV)/ready  ## pin every dependency, for all systems and Pythons of pyproject.toml
	$(BIN)/uv pip compile --universal --extra dev --generate-hashes --no-header --upgrade -q \
		pyproject.toml -o $(LOCK)
	$(BIN)/uv pip compile --universal --extra dev --extra docs --generate-hashes --no-header --upgrade -q \
		--constraint $(LOCK) pyproject.toml -o .ci/docs/requirements.lock

sbom: $(VENV)/ready  ## sbom.cdx.json: bill of materials of the program with all extras (CycloneDX)
	$(BIN)/uv pip compile --quiet --universal --extra all --generate-hashes --no-header \
		--constraint $(LOCK) pyproject.toml -o $(VENV)/all.txt
	$(BIN)/uv tool run --quiet --from cyclonedx-bom==7.* cyclonedx-py requirements $(VENV)/all.txt \
		--pyproject pyproject.toml --output-reproducible --of JSON -o sbom.cdx.json

audit: $(VENV)/ready  ## known vulnerabilities of the locked packages
	$(BIN)/uv tool run --quiet pip-audit -r $(LOCK) --disable-pip --require-hashes

clean:  ## remove .venv and the demo's output
	rm -rf $(VENV) demo-output

help:  ## this list
	@awk -F ':.*##' '/^[a-z-]+:.*##/ { printf "  make %-10s %s\n", $$1, $$2 }' Makefile
