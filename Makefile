# make demo: set everything up, drop the thesis's sphere, write out/bounce.mp4
# make test: set everything up, run the tests that take minutes; make test-all: those that take an hour, too

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-fast test-all test-bounds native test-native test-platforms dist-native lint profile report peers gallery docs clean

VENV := .venv
BIN := $(VENV)/bin

help:
	@echo "make demo     set up, drop a soft sphere, write out/bounce.mp4"
	@echo "make test     set up, run the tests, but those that take long"
	@echo "make test-fast  set up, run tests without worlds: for the inner loop"
	@echo "make test-all set up with every extra, run every test: an hour"
	@echo "make test-bounds  set up, run kernels with every index checked: takes minutes"
	@echo "make native   set up, build the library for engines without Python and its sample, into out/native"
	@echo "make test-native  set up, build it, play games in it and in Python"
	@echo "make test-platforms  set up, build it for other platforms, play games on all that run here"
	@echo "make dist-native  build it for all platforms, pack it with headers, wrappers and sample into dist; and a project for Godot 3"
	@echo "make profile  set up, measure what a frame costs here"
	@echo "make report   set up, run the thesis's experiments, write out/report: takes minutes"
	@echo "make peers    set up with other engines, drop one body in all of them, write out/peers.mp4"
	@echo "make gallery  set up, film every demo and export worlds to play for the documentation: takes minutes"
	@echo "make docs     set up, build the documentation into out/docs"
	@echo "make lint     set up with every extra, check style and types"
	@echo "make setup    set up with every extra"
	@echo "make clean    delete the environment and what was written"

# One environment for all of them; each adds to it what it needs.
$(VENV)/.%: pyproject.toml taichi_soft/core/version.py setup.sh
	@sh setup.sh "$(VENV)" $*
	@touch $@

setup: $(VENV)/.dev

demo: $(VENV)/.demo
	@$(BIN)/taichi-soft demo bounce --seconds 5 --out out/bounce.mp4

test: $(VENV)/.test
	@$(BIN)/python -m pytest -m "not soak"

test-fast: $(VENV)/.test
	@$(BIN)/python -m pytest -m "numpy or kernel"

test-all: $(VENV)/.dev
	@$(BIN)/python -m pytest $(PYTEST)

test-bounds: $(VENV)/.test
	@TAICHI_SOFT_DEBUG=1 $(BIN)/python -m pytest tests/bounds

native: $(VENV)/.export
	@for tool in cmake g++; do command -v $$tool > /dev/null || { echo "make native needs $$tool: install it first"; exit 1; }; done
	@mkdir -p out
	@cmake -S engine_adapter/native -B out/native > out/native.log || { cat out/native.log; exit 1; }
	@cmake --build out/native
	@$(BIN)/taichi-soft export engine_adapter/native/sample/game.py --out out/game.softworld
	@echo "try it: out/native/game out/game.softworld"

test-native: $(VENV)/.test $(VENV)/.export
	@$(BIN)/python -m pytest tests/native

test-platforms: $(VENV)/.test $(VENV)/.export
	@$(BIN)/python tests/native/platforms.py

# One for each platform, for C, C++ and C#; a package of npm for the web; and a project for Godot 3. GODOT_HEADERS= names a folder of Godot's headers,
# where they cannot be fetched.
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
	@cd dist && { npm pack --silent ../out/npm || echo "npm is not here: dist has no package for the web"; }
	@cmake -S engine_adapter/godot -B out/godot3 -DTAICHI_SOFT_DIR=$(CURDIR)/out/native -DGODOT_HEADERS="$(GODOT_HEADERS)" \
	    -DTAICHI_SOFT_GODOT_WORLD=$(CURDIR)/out/godot3/demo.softworld > out/godot3/cmake.log 2>&1 \
	    || { if grep -q "headers cannot be fetched" out/godot3/cmake.log; \
	         then echo "no .zip for Godot: its headers cannot be fetched; name a folder of them: make dist-native GODOT_HEADERS="; \
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
