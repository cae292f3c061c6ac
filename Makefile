# Virtual Aperture. `make demo` and `make test` set up what they need.
VENV := .venv
PYTHON := $(VENV)/bin/python
PLATFORM ?= linux-x64
# Test processes side by side; each has a Blender of its own.
JOBS ?= 2

# A part of the benchmark: make bench SCENES="bars slope" TRACK=T1 BLURS="24 48" METHODS=layers
# A part of the costs: make bench-speed PARTS="'growth with blur' 'equal error'"
# A part of the solve benchmark: make bench-solve MOTIONS="ahead mover" TRACKERS=corners FOCAL=unknown
SOLVES := $(if $(MOTIONS),--motions $(MOTIONS)) $(if $(TRACKERS),--trackers $(TRACKERS)) $(if $(FOCAL),--focal $(FOCAL))
# A part of the gallery: make real CLIPS="dog cat"; of another checkout's code: make real PROGRAM=../old/addon/headless.py NAME=real-old
REAL := $(if $(CLIPS),--clips $(CLIPS)) $(if $(PROGRAM),--program $(PROGRAM)) $(if $(NAME),--name $(NAME))
BENCH := $(if $(SCENES),--scenes $(SCENES)) $(if $(TRACK),--track $(TRACK)) $(if $(BLURS),--blurs $(BLURS)) $(if $(METHODS),--methods $(METHODS)) $(if $(STATUS),--status)

.PHONY: help setup demo test test-fast test-all test-window test-window-smoke pictures store-pictures store-video moving-picture torture sample real bench bench-speed bench-solve bench-stability figures lint zip store store-check docs clean
help:
	@echo "make demo    render the sample clip with depth of field and say where the video is"
	@echo "make test    run the tests of the add-on"
	@echo "make test-fast  those without Blender, solves, subjects and other processes"
	@echo "make test-all  and long solves, real data and the benchmarks' own"
	@echo "make test-window  drive a real Blender on a virtual screen with mouse and keys (BLENDER=PROGRAM); BACKEND=vulkan: a part of them"
	@echo "make test-window-smoke  a few of them, five minutes: install, drop a clip, solve, preview, pick focus, F12, a movie"
	@echo "make pictures  take the documentation's pictures in a real Blender (BLENDER=PROGRAM), into docs/pictures/"
	@echo "make moving-picture  the sample clip with its focus pulled, as the README opens with it"
	@echo "make store-pictures  the icon and the featured picture of the store's page, into docs/store/"
	@echo "make store-video  the video of that page, of the screenshots that make pictures took, into docs/store/"
	@echo "make torture  kills, full disks, races and damaged files for hours; resumes (TRIES=100 FAULTS=\"movie jobs\")"
	@echo "make sample SCENE=bars  a scene of the benchmark: .blend, clip and true cameras, into sample/"
	@echo "make real    real clips (real data): solved or why not, detail, noise, flicker, masks; contact sheets to look at"
	@echo "make bench   every method against a real lens, within the hour; resumes (STATUS=1: what is stale, SCENES=bars TRACK=T1: a part)"
	@echo "make bench-speed      what a clip costs and how that grows, kept in benchmarks/results; a frame by stage"
	@echo "make bench-solve      cameras against truth: sixteen motions and nine refusals, four trackers"
	@echo "make bench-stability  the hard numerical cases, a table"
	@echo "make figures          the thesis's figures from our scenes, into docs/figures/"
	@echo "make lint    ruff and mypy"
	@echo "make zip     build the extension into dist/ (PLATFORM=linux-x64, windows-x64, macos-arm64)"
	@echo "make store   the zips of all platforms for Blender's own builds, and the index of a repository, into dist/store/ (WEBSITE=URL of the documentation)"
	@echo "make store-check  those zips against the list of the store's reviewers, and what weighs how much in them (BLENDER=PROGRAM validates, too)"
	@echo "make docs    the documentation as a site with search, into build/site/; a dead link fails"
	@echo "make setup   the virtual environment alone"
	@echo "make clean   remove what was built"

setup: $(VENV)/.done

$(VENV)/.done: pyproject.toml tools/setup.sh
	@bash tools/setup.sh $(VENV)
	@touch $@

demo: setup
	@$(PYTHON) sample_scenes/demo.py

# A file's tests stay in one process, which makes their fixtures once; the longest files begin (tests/conftest.py).
TESTS := $(PYTHON) -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder

test: setup
	@$(TESTS) -m "not data and not long" --ignore=tests/benchmarks

test-all: setup
	@$(TESTS)

test-fast: setup
	@$(PYTHON) -m pytest --fast -q -n $(JOBS) --dist worksteal -m "not long" --ignore=tests/benchmarks

# With a backend other than Blender's own choice, what draws with it.
DRAWING := tests/window/test_renders.py tests/window/test_view_and_panel.py tests/window/test_pick_focus.py \
	tests/window/test_picture.py \
	tests/window/test_off_and_on.py tests/window/test_file_drop.py tests/window/test_gpu_sweep.py
WINDOW_TESTS := -m "not long" $(if $(BACKEND),$(DRAWING),tests/window)

test-window: setup
	@command -v "$${BLENDER:-blender}" >/dev/null \
	  || { echo "make test-window: no Blender program; set BLENDER to one, or put blender on the path" >&2; exit 1; }
	@$(PYTHON) tools/build_zip.py
	@rm -rf build/window
	@BACKEND=$(BACKEND) $(TESTS) $(WINDOW_TESTS)

test-window-smoke:
	@$(MAKE) --no-print-directory test-window JOBS=1 WINDOW_TESTS="-m smoke tests/window"

pictures: setup
	@$(PYTHON) tools/build_zip.py
	@$(PYTHON) -m pytest tests/window/test_pictures.py
	@mkdir -p docs/pictures && cp build/window/pictures/docs/*.jpg docs/pictures/
	@$(PYTHON) sample_scenes/moving_picture.py --screens build/window/pictures --out docs/at_work.webp

moving-picture: setup
	@$(PYTHON) sample_scenes/moving_picture.py --out docs/focus_pull.webp

store-pictures: setup
	@$(PYTHON) -m sample_scenes.store_pictures

store-video: setup
	@$(PYTHON) -m sample_scenes.store_video

torture: setup
	@$(PYTHON) -m benchmarks.torture $(if $(TRIES),--tries $(TRIES)) $(if $(FAULTS),--faults $(FAULTS))

sample: setup
	@$(PYTHON) sample_scenes/filming.py $(SCENE) --out sample/$(SCENE)

real: setup
	@$(PYTHON) -m benchmarks.gallery $(REAL)

bench: setup
	@$(PYTHON) -m benchmarks.accuracy $(BENCH)
	$(if $(STATUS),,@$(PYTHON) -m benchmarks.quoted)

bench-speed: setup
	@$(PYTHON) -m benchmarks.timings.speed $(if $(PARTS),--parts $(PARTS))
	@$(PYTHON) -m benchmarks.timings.frame_costs

bench-solve: setup
	@$(PYTHON) -m benchmarks.solving $(SOLVES)
	@$(PYTHON) -m benchmarks.quoted

bench-stability: setup
	@$(PYTHON) -m benchmarks.stability

figures: setup
	@$(PYTHON) -m benchmarks.thesis

lint: setup
	@$(VENV)/bin/ruff check .
	@$(VENV)/bin/ruff format --check .
	@$(VENV)/bin/mypy

zip: setup
	@$(PYTHON) tools/build_zip.py --platform $(PLATFORM)

store: setup
	@$(PYTHON) tools/build_zip.py --store $(if $(WEBSITE),--website $(WEBSITE))

store-check: setup
	@$(PYTHON) tools/store_check.py

docs: setup
	@$(PYTHON) tools/docs_site.py

clean:
	rm -rf build dist demo sample .mypy_cache .ruff_cache .pytest_cache
