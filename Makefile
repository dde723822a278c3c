# make demo     solves example 1: prints a table, writes out/example1.json and out/example1.png
# make test     runs all checks and tests but those that take long
# make test-all runs the tests that take long, too
# make docs     builds the documents as a site: out/site/index.html
# make wheel    builds a wheel that anyone can install, in dist; tests it in an empty environment, without cargo
# make figures  draws the pictures of README.md and docs
# make bench    measures the times of fishbone and of its alternatives, and writes docs/performance.md
# make clean    removes the files that these targets made
#
# `make bench BENCH="--only cold --dry-run"` measures a part and saves nothing.
# Needs cargo, Python 3.10 or newer and make; everything else goes into .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m pip --quiet --disable-pip-version-check
CORE := python/fishbone/_core.abi3.so
WASM := wasm32-unknown-unknown
SITE := out/site

# Linked by zig, a wheel of Linux runs on systems from 2014 on; any other is for systems like this one.
HOST = $(shell rustc -vV 2>/dev/null | sed -n 's/^host: //p')
ZIG = $(if $(filter x86_64-unknown-linux-gnu aarch64-unknown-linux-gnu,$(HOST)),--zig --compatibility manylinux2014)

NEED_CARGO := @command -v cargo >/dev/null || { echo "fishbone needs cargo, which comes with Rust: https://rustup.rs" >&2; exit 1; }

# The inputs of each step, so that a second run redoes only the steps whose inputs have changed.
RUST_SOURCES := Cargo.toml Cargo.lock $(shell find crates scenarios -type f)
PYTHON_SOURCES := pyproject.toml $(shell find python tests benchmarks docs examples -name '*.py' -o -name '*.pyi')
TEXTS := $(shell find *.md LICENSE CITATION.cff docs scenarios tests -type f -not -name '*.pyc' 2>/dev/null)

# Compilers look for make's jobs where these flags are, and cargo has jobs of its own.
unexport MAKEFLAGS

.PHONY: help demo test test-all docs wheel figures bench clean
.DELETE_ON_ERROR:

help:
	@sed -n 's/^# \(make .*\)/\1/p' Makefile

demo: $(CORE)
	@mkdir -p out
	@$(BIN)/fishbone solve scenarios/example1.toml --out out/example1.json --figure out/example1.png
	@echo "out/example1.json and out/example1.png written"

test: $(VENV)/.rust $(VENV)/.wasm $(VENV)/.lint $(VENV)/.pytest $(SITE)/index.html
	@echo "all tests pass"

test-all: test $(VENV)/.pytest-full
	@echo "and so do those that take long"

docs: $(SITE)/index.html
	@echo "$< written"

# Always built afresh: Sphinx warns about a page only when it reads the page.
$(SITE)/index.html: $(CORE) $(PYTHON_SOURCES) $(TEXTS)
	@echo "building the documents"
	@rm -rf $(SITE)
	@$(BIN)/python -m sphinx --quiet --fail-on-warning --keep-going --conf-dir docs --doctree-dir $(SITE)/.doctrees . $(SITE)
	@rm -r $(SITE)/.doctrees
	@cp $(SITE)/README.html $@

# The wheel is built from the source distribution, which tests that it is complete. The core has no path of this machine.
wheel: $(VENV)/.wheel
	$(NEED_CARGO)
	@echo "building a wheel (a few minutes the first time)"
	@rm -rf dist
	@cargo fetch --quiet --locked
	@places="$$(rustc --print sysroot) $$(echo "$${CARGO_HOME:-$$HOME/.cargo}"/registry/src/*)"; \
	RUSTFLAGS="$$(printf -- '--remap-path-prefix=%s= ' $$places)" PATH="$(CURDIR)/$(BIN):$$PATH" \
	$(BIN)/maturin build --sdist --release $(ZIG) --target-dir target/wheel --out dist >$(VENV)/wheel.log 2>&1 \
	|| { cat $(VENV)/wheel.log >&2; exit 1; }
	@$(BIN)/python tests/wheel.py

$(VENV)/.wheel: $(VENV)/.packages requirements-wheel.txt
	@$(if $(ZIG),$(PIP) install --requirement requirements-wheel.txt,:)
	@touch $@

figures: $(CORE)
	@PYTHONPATH=benchmarks $(BIN)/python docs/make_figures.py

# On one thread: on matrices as small as these, further threads of BLAS only wait, and their waiting is in the times.
bench: $(VENV)/.bench
	@PYTHONPATH=benchmarks OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m speed $(BENCH)

$(VENV)/.bench: $(CORE) benchmarks/requirements.txt
	@$(PIP) install --requirement benchmarks/requirements.txt
	@touch $@

clean:
	@rm -rf $(VENV) out dist $(CORE)
	@cargo clean --quiet

$(VENV)/.packages: requirements-dev.txt
	$(NEED_CARGO)
	@command -v $(PYTHON) >/dev/null || { echo "fishbone needs Python 3.10 or newer; name yours with: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || { echo "fishbone needs Python 3.10 or newer, found $$($(PYTHON) --version); name another with: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "fishbone needs Python's venv module; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	@echo "installing Python packages into $(VENV)"
	@$(PYTHON) -m venv --clear $(VENV)
	@$(PIP) install --requirement requirements-dev.txt
	@touch $@

$(CORE): $(VENV)/.packages $(RUST_SOURCES) pyproject.toml
	$(NEED_CARGO)
	@echo "building the Rust core (a few minutes the first time)"
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

# fishbone-py has no tests in Rust. Left out, it adds no features to the crates below it, so that the library for C, which a
# test builds by itself, takes the core that is there.
$(VENV)/.rust: $(VENV)/.packages $(RUST_SOURCES) docs/c.md
	$(NEED_CARGO)
	@echo "checking the Rust code"
	@cargo fmt --all --check
	@cargo clippy --quiet --locked --workspace --all-targets -- --deny warnings
	@cargo clippy --quiet --locked --package fishbone --no-default-features --all-targets -- --deny warnings
	@RUSTDOCFLAGS="--deny warnings" cargo doc --quiet --locked --no-deps --package fishbone --package stagewise
	@echo "testing the Rust code"
	@cargo test --quiet --locked --workspace --exclude fishbone-py
	@touch $@

# Without the target no stamp is left, so that every run reports it.
$(VENV)/.wasm: $(VENV)/.packages $(RUST_SOURCES)
	$(NEED_CARGO)
	@if test -d "$$(rustc --print target-libdir --target $(WASM))"; then \
	  echo "building the mechanics for $(WASM), without the feature io and with it"; \
	  cargo build --quiet --locked --target $(WASM) --package fishbone --no-default-features && \
	  cargo build --quiet --locked --target $(WASM) --package fishbone && \
	  touch $@; \
	else \
	  echo "left out: building the mechanics for $(WASM); to have it: rustup target add $(WASM)"; \
	fi

$(VENV)/.lint: $(CORE) $(PYTHON_SOURCES)
	@echo "checking the Python code"
	@$(BIN)/ruff check --quiet .
	@$(BIN)/ruff format --quiet --check .
	@$(BIN)/python -m mypy --no-error-summary
	@$(BIN)/python -m mypy.stubtest --concise fishbone._core
	@touch $@

# A worker for each core, up to eight. Each starts with tests that stand together and share what is solved once. Under
# `make --jobs` they wait for the tests in Rust: some of them watch the clock.
$(VENV)/.pytest: $(CORE) $(PYTHON_SOURCES) $(TEXTS) | $(VENV)/.rust $(VENV)/.wasm
	@echo "testing the Python code"
	@$(BIN)/python -m pytest --quiet --numprocesses auto --maxprocesses 8 --dist worksteal
	@touch $@

# In one process: a whole search takes all cores by itself, and is made once for all tests of it.
$(VENV)/.pytest-full: $(CORE) $(PYTHON_SOURCES) $(TEXTS)
	@echo "testing what takes long"
	@$(BIN)/python -m pytest --quiet -m full
	@touch $@
