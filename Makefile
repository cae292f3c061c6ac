# Virtual Aperture. `make demo` and `make test` set up what they need.
VENV := .venv
PYTHON := $(VENV)/bin/python
PLATFORM ?= linux-x64

.PHONY: help setup demo test lint zip clean
help:
	@echo "make demo    render the sample clip with depth of field and say where the video is"
	@echo "make test    run the tests"
	@echo "make lint    ruff and mypy"
	@echo "make zip     build the extension into dist/ (PLATFORM=linux-x64, windows-x64, macos-arm64)"
	@echo "make setup   the virtual environment alone"
	@echo "make clean   remove what was built"

setup: $(VENV)/.done

$(VENV)/.done: pyproject.toml tools/setup.sh
	@bash tools/setup.sh $(VENV)
	@touch $@

demo: setup
	@$(PYTHON) sample_scenes/demo.py

test: setup
	@$(PYTHON) -m pytest

lint: setup
	@$(VENV)/bin/ruff check .
	@$(VENV)/bin/ruff format --check .
	@$(VENV)/bin/mypy

zip: setup
	@$(PYTHON) tools/build_zip.py --platform $(PLATFORM)

clean:
	rm -rf build dist demo .mypy_cache .ruff_cache .pytest_cache
