# make cantilever   set up what is missing, run the study of the cantilever
# make test         set up what is missing, run the tests (TESTS="..." selects files of pytest)
# make quick        the tests that start no ranks
# make test-all     all tests, also the slow ones: extremes, studies, endurance, large cases
# make fuzz         test random arguments (SEED=... repeats a run)
# make docs         the documentation as HTML; runs its scripts and cases (PAGE=start builds one page,
#                   SCREENS=1 writes pictures of the pages, LINKS=1 checks the web's links,
#                   THUMBNAILS=1 draws the pictures of README's gallery)
# make matrix       make test-all on Debian 12, 13 and sid, each in a throw-away root (see tests/matrix.sh)
# make extremes     try the method at its limits, print the settings that survive or are rejected
# make bench        speed and memory, stage by stage (AGAINST=../checkout compares with another checkout)
# make trade        cost of accuracy: the settings of five cases; resumes an interrupted study
# make lint, make format, make clean
#
# Set-up needs Debian 12, 13 or sid (root or sudo for the packages that are missing) and Rust.

SHELL := /bin/sh
PYTHON := .venv/bin/python
STAMPS := .venv/stamps
RUST_MINIMUM := 1.83
DEBIAN := python3-dolfinx-real python3-petsc4py-real python3-mpi4py python3-scipy python3-cffi \
	libopenblas0-serial python3-venv python3-dev g++ openmpi-bin ca-certificates

# One thread per process in BLAS: the assembly and the particles use the other cores.
export OMP_NUM_THREADS ?= 1
# Open MPI refuses to start ranks as root, which containers and fresh machines are.
export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1

.PHONY: cantilever test quick test-all fuzz docs matrix extremes bench trade lint format setup clean
.NOTPARALLEL:
.DELETE_ON_ERROR:

cantilever: setup
	$(PYTHON) -m cases.verification.cantilever

# A file is tested by one process, so that what its tests share is computed once.
# nproc obeys OMP_NUM_THREADS, which make 4.4 passes on to $(shell).
PYTEST = $(PYTHON) -m pytest --quiet -n $(shell env -u OMP_NUM_THREADS nproc) --dist loadfile --no-loadscope-reorder

test: setup $(STAMPS)/cargo-tests
	cargo test --locked --quiet
	$(PYTEST) -m 'not slow' $(TESTS)

quick: setup $(STAMPS)/cargo-tests
	cargo test --locked --quiet
	$(PYTEST) -m 'not slow and not mpi' $(TESTS)

test-all: setup $(STAMPS)/cargo-tests $(STAMPS)/docs $(STAMPS)/notebook
	cargo test --locked --quiet
	$(PYTEST) $(TESTS)
	$(PYTHON) -m cases.extremes --short

fuzz: SEED := $(or $(SEED),$(shell od -An -N4 -tu4 /dev/urandom | tr -d ' '))
fuzz: setup $(STAMPS)/cargo-tests
	@echo "Repeat with the same examples: make fuzz SEED=$(SEED)"
	PROPTEST_RNG_SEED=$(SEED) PROPTEST_CASES=5000 cargo test --locked --quiet
	HYPOTHESIS_PROFILE=fuzz SEED=$(SEED) $(PYTEST) -m 'fuzz or hypothesis' --hypothesis-seed=$(SEED) $(TESTS)

docs: setup $(STAMPS)/docs $(STAMPS)/notebook
	$(PYTHON) python/docs $(if $(PAGE),--page $(PAGE)) $(if $(SCREENS),--screens) $(if $(LINKS),--links) $(if $(THUMBNAILS),--thumbnails)

matrix:
	tests/matrix.sh

extremes: setup
	$(PYTHON) -m cases.extremes

bench: setup
	$(PYTHON) -m cases.costs.bench $(if $(AGAINST),--against $(AGAINST))
	$(if $(AGAINST),,$(PYTHON) -m cases.costs.solvers)

trade: setup
	$(PYTHON) -m cases.costs.trade

lint: setup $(STAMPS)/lint
	cargo fmt --check
	cargo clippy --locked --all-targets --quiet -- -D warnings
	PYO3_PYTHON=$(CURDIR)/$(PYTHON) cargo clippy --locked --features python --quiet -- -D warnings
	.venv/bin/ruff check --quiet .
	.venv/bin/ruff format --check .
	.venv/bin/mypy
	$(PYTHON) -m mypy.stubtest tawami._rust --ignore-disjoint-bases

format: setup $(STAMPS)/lint
	cargo fmt
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

clean:
	rm -rf .venv target results .pytest_cache

setup: $(STAMPS)/wheel

# The one prerequisite comes first, before anything is installed.
$(STAMPS)/rust:
	@found=$$(cargo --version 2>/dev/null | cut -d' ' -f2); \
	if [ -z "$$found" ]; then \
		echo "tawami needs a Rust toolchain >= $(RUST_MINIMUM), and cargo was not found: install it with rustup (or Debian's cargo, from Debian 13 on) and run make again" >&2; exit 1; \
	elif [ "$$(printf '%s\n' $(RUST_MINIMUM) $$found | sort -V | head -n 1)" != $(RUST_MINIMUM) ]; then \
		echo "tawami needs a Rust toolchain >= $(RUST_MINIMUM), and cargo is $$found: run rustup update and make again" >&2; exit 1; \
	fi
	@mkdir -p $(STAMPS) && touch $@

# Installs those of the packages $(1) that are missing.
define from_debian
	@command -v apt-get >/dev/null || { echo "tawami takes packages from Debian, and apt-get was not found: expected Debian 12, 13 or sid" >&2; exit 1; }
	@missing=; for package in $(1); do \
		dpkg-query -W -f '$${Status}' $$package 2>/dev/null | grep -q 'ok installed' || missing="$$missing $$package"; \
	done; \
	if [ -n "$$missing" ]; then \
		echo "Installing from Debian:$$missing"; \
		if [ "$$(id -u)" = 0 ]; then root=; elif command -v sudo >/dev/null; then root=sudo; \
		else echo "Installing needs root: run 'apt-get install$$missing' as root, then make again" >&2; exit 1; fi; \
		$$root apt-get update -qq </dev/null && \
		$$root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends $$missing </dev/null >/dev/null || \
		{ echo "Debian's packages could not be installed: see the message of apt-get above" >&2; exit 1; }; \
	fi
endef

$(STAMPS)/debian: $(STAMPS)/rust Makefile
	$(call from_debian,$(DEBIAN))
	@touch $@

# The system's Python, because dolfinx lives in its dist-packages; NumPy and SciPy must stay the
# ones that dolfinx was built with, also when a user installs other packages into .venv.
.venv/constraints.txt: $(STAMPS)/debian
	/usr/bin/python3 -m venv --system-site-packages .venv
	$(PYTHON) -c "import numpy, scipy; print(f'numpy=={numpy.__version__}\nscipy=={scipy.__version__}')" > $@.part
	mv $@.part $@

.venv/pip.conf: .venv/constraints.txt
	printf '[install]\nconstraint = %s\n' '$(CURDIR)/.venv/constraints.txt' > $@

PIP = $(PYTHON) -m pip install --quiet --disable-pip-version-check

$(STAMPS)/python: .venv/pip.conf pyproject.toml
	$(PIP) 'maturin>=1.12.1,<2' 'filelock>=4.3' 'meshio>=5.3' 'shapely>=2.1' 'matplotlib>=3.7' 'tqdm>=4.60' 'hypothesis>=6.80' 'mypy>=1.10' 'pytest>=7.4' 'pytest-xdist>=3.7'
	@mkdir -p $(STAMPS) && touch $@

$(STAMPS)/lint: $(STAMPS)/python
	$(PIP) 'ruff>=0.6'
	@mkdir -p $(STAMPS) && touch $@

$(STAMPS)/docs: $(STAMPS)/python Makefile
	$(call from_debian,chromium)
	$(PIP) 'sphinx>=7.2' 'myst-nb>=1.1' 'ipykernel>=6.25' 'furo>=2024.1.29' 'sphinx-design>=0.6' 'sphinx-mathjax-offline>=0.0.2' 'playwright>=1.40'
	@mkdir -p $(STAMPS) && touch $@

$(STAMPS)/notebook: $(STAMPS)/python Makefile
	$(PIP) 'ipykernel>=6.25' 'pandas>=2.0' 'pyvista>=0.42'
	@mkdir -p $(STAMPS) && touch $@

# Built for the processor it runs on, and built again for another one.
PROCESSOR := $(STAMPS)/processor-$(shell grep -m 1 -i flags /proc/cpuinfo 2>/dev/null | cksum | cut -d' ' -f1)
$(PROCESSOR): $(STAMPS)/rust
	@touch $@

$(STAMPS)/wheel: $(STAMPS)/python $(PROCESSOR) Cargo.toml Cargo.lock $(shell find rust -name '*.rs')
	@echo "Compiling the Rust part (about a minute)"
	RUSTFLAGS="-C target-cpu=native" VIRTUAL_ENV=$(CURDIR)/.venv PIP_CONSTRAINT=$(CURDIR)/.venv/constraints.txt .venv/bin/maturin develop --release --locked --quiet >/dev/null
	@touch $@

# Compiled beforehand: it takes longer than the tests themselves.
$(STAMPS)/cargo-tests: $(STAMPS)/rust Cargo.toml Cargo.lock $(shell find rust -name '*.rs') $(wildcard tests/*.rs tests/*/*.rs)
	cargo test --locked --quiet --no-run
	@mkdir -p $(STAMPS) && touch $@
