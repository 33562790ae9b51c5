# make demo: set everything up, drop the thesis's sphere, write out/bounce.mp4
# make test: set everything up, run the tests that take minutes; make test-all: those that take half an hour, too

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-fast test-all test-bounds lint profile clean

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

help:
	@echo "make demo     set up, drop a soft sphere, write out/bounce.mp4"
	@echo "make test     set up, run the tests, but those that take long"
	@echo "make test-fast  set up, run tests without worlds: for the inner loop"
	@echo "make test-all set up, run every test: half an hour"
	@echo "make test-bounds  set up, run kernels with every index checked: takes minutes"
	@echo "make profile  set up, measure what a frame costs here"
	@echo "make lint     set up, check style and types"
	@echo "make clean    delete the environment and what was written"

setup: $(READY)

$(READY): pyproject.toml setup.sh
	@sh setup.sh "$(VENV)"
	@touch $@

demo: $(READY)
	@$(BIN)/taichi-soft demo bounce --out out/bounce.mp4

test: $(READY)
	@$(BIN)/python -m pytest -m "not soak"

test-fast: $(READY)
	@$(BIN)/python -m pytest -m "numpy or kernel"

test-all: $(READY)
	@$(BIN)/python -m pytest

test-bounds: $(READY)
	@TAICHI_SOFT_DEBUG=1 $(BIN)/python -m pytest tests/bounds

profile: $(READY)
	@$(BIN)/taichi-soft profile

lint: $(READY)
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

clean:
	rm -rf $(VENV) out build *.egg-info
