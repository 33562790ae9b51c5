# make demo: set everything up, drop the thesis's sphere, write out/bounce.mp4
# make test: set everything up, run the tests except the slow ones (minutes); make test-changed: with the slow ones that guard what
# changed since a revision (half an hour); make test-all: run every test (an hour)

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-fast test-changed test-all test-bounds native test-native test-platforms dist-native lint profile report peers gallery docs clean

VENV := .venv
BIN := $(VENV)/bin
SINCE := HEAD

help:
	@echo "make demo     set up, drop a soft sphere, write out/bounce.mp4"
	@echo "make test     set up, run the tests, except the slow ones"
	@echo "make test-fast  set up, run the tests that build no world (seconds to minutes)"
	@echo "make test-changed SINCE=main  set up with every extra, run the tests and the slow ones that guard what changed"
	@echo "make test-all set up with every extra, run every test (an hour)"
	@echo "make test-bounds  set up, run kernels with every index checked (minutes)"
	@echo "make native   set up, build the C library and its sample into out/native"
	@echo "make test-native  set up, build the C library, compare its results with those of Python"
	@echo "make test-platforms  set up, build the C library for all platforms, test those that can run here"
	@echo "make dist-native  build the C library for all platforms, pack it and a Godot 3 project into dist"
	@echo "make profile  set up, measure the frame time on this machine"
	@echo "make report   set up, run the thesis's experiments, write out/report (minutes)"
	@echo "make peers    set up with other engines, drop one body in each, write out/peers.mp4"
	@echo "make gallery  set up, film every demo and export playable worlds for the documentation (minutes)"
	@echo "make docs     set up, build the documentation into out/docs"
	@echo "make lint     set up with every extra, check style and types"
	@echo "make setup    set up with every extra"
	@echo "make clean    delete the environment and all outputs"

# All targets share one environment. Each target installs what it needs.
$(VENV)/.%: pyproject.toml taichi_soft/core/version.py setup.sh
	@sh setup.sh "$(VENV)" $*
	@touch $@

setup: $(VENV)/.dev

demo: $(VENV)/.demo
	@$(BIN)/taichi-soft demo bounce --seconds 5 --out out/bounce.mp4

test: $(VENV)/.test
	@$(BIN)/python -m pytest -m "not soak"

test-fast: $(VENV)/.test
	@$(BIN)/python -m pytest -m "(numpy or kernel) and not soak"

# In two parts, because each test process keeps the machine code of every world that it has built.
test-changed: $(VENV)/.dev
	@failed=0; for kind in "not soak" soak; do \
		$(BIN)/python -m pytest -m "$$kind" --since "$(SINCE)" $(PYTEST) || failed=1; \
	done; exit $$failed

test-all: $(VENV)/.dev
	@$(BIN)/python -m pytest $(PYTEST)

test-bounds: $(VENV)/.test
	@TAICHI_SOFT_DEBUG=1 $(BIN)/python -m pytest tests/bounds $(PYTEST)

native: $(VENV)/.export
	@for tool in cmake g++; do command -v $$tool > /dev/null || { echo "make native needs $$tool. Install it first."; exit 1; }; done
	@mkdir -p out
	@cmake -S engine_adapter/native -B out/native > out/native.log || { cat out/native.log; exit 1; }
	@cmake --build out/native
	@$(BIN)/taichi-soft export engine_adapter/native/sample/game.py --out out/game.softworld
	@echo "try it: out/native/game out/game.softworld"

test-native: $(VENV)/.test $(VENV)/.export
	@$(BIN)/python -m pytest tests/native

test-platforms: $(VENV)/.test $(VENV)/.export
	@$(BIN)/python tests/native/platforms.py

# For C, C++ and C# one .zip per platform; for the web an npm package; and a Godot 3 project. If Godot's headers cannot be downloaded,
# set GODOT_HEADERS= to a folder that contains them.
dist-native: native
	@mkdir -p dist out/godot3
	@for platform in linux-x64 linux-arm64 windows-x64 macos-arm64; do \
	    echo "building for $$platform"; \
	    { cmake -S engine_adapter/native -B out/$$platform -DPLATFORM=$$platform -DCMAKE_TOOLCHAIN_FILE=$(CURDIR)/engine_adapter/native/zig.cmake \
	        -DZIG="$$($(BIN)/python -c 'import importlib.util as u; print(u.find_spec("ziglang").submodule_search_locations[0])')/zig" \
	        && cmake --build out/$$platform && cd out/$$platform && cpack -B $(CURDIR)/dist && cd ../..; } > out/$$platform.log 2>&1 \
	    || { cat out/$$platform.log; exit 1; }; \
	done
	@mkdir -p out/npm
	@cp engine_adapter/web/*.js engine_adapter/web/*.ts engine_adapter/web/*.json engine_adapter/web/README.md LICENSE out/npm
	@cd dist && { npm pack --silent ../out/npm || echo "npm is not installed, so dist has no package for the web"; }
	@cmake -S engine_adapter/godot -B out/godot3 -DTAICHI_SOFT_DIR=$(CURDIR)/out/native -DGODOT_HEADERS="$(GODOT_HEADERS)" \
	    -DTAICHI_SOFT_GODOT_WORLD=$(CURDIR)/out/godot3/demo.softworld > out/godot3/cmake.log 2>&1 \
	    || { if grep -q "headers cannot be fetched" out/godot3/cmake.log; \
	         then echo "no .zip for Godot, because its headers cannot be downloaded: set the folder that contains them, make dist-native GODOT_HEADERS="; \
	         else cat out/godot3/cmake.log; fi; exit 1; }
	@cmake --build out/godot3
	@cp engine_adapter/godot/demo/world.py assets/elephant.glb out/godot3
	@$(BIN)/taichi-soft export out/godot3/world.py --axes y-up --out out/godot3/demo.softworld
	@cd out/godot3 && cpack -B $(CURDIR)/dist > cpack.log || { cat cpack.log; exit 1; }
	@rm -r dist/_CPack_Packages
	@ls -l dist

profile: $(VENV)/.demo
	@$(BIN)/taichi-soft profile

report: $(VENV)/.lab
	@$(BIN)/python -m lab report $(REPORT)

peers: $(VENV)/.demo $(VENV)/.peers
	@$(BIN)/python -m lab peers $(PEERS)

gallery: $(VENV)/.demo
	@$(BIN)/python docs/make_gallery.py $(GALLERY)
	@$(BIN)/python docs/make_worlds.py $(WORLDS)

docs: $(VENV)/.docs
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

lint: $(VENV)/.dev
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

clean:
	rm -rf $(VENV) out build dist *.egg-info
