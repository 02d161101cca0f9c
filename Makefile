# make demo | make test | make test-all | make bench | make lint | make soak [MINUTES=10] [MESH=mug.ply] | make audit
# make evidence [ARGS=--list] | make evidence-check | make docs
# Each sets up .venv first, as far as that is still to do. Another Python: make PYTHON=python3.12 demo
# Another ROS distribution, in an environment of its own, here .venv-kilted: make ROS=kilted test

PYTHON ?= python3
MINUTES ?= 10
TESTS ?= not slow
# Not what the environment may say: a name as short as this may mean anything there.
ROS := jazzy
# A file at a time on every core, which needs no threads beside.
PYTEST = OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest \
	--numprocesses logical --maxprocesses 4 --dist loadfile
BIN := .venv$(if $(filter-out jazzy,$(ROS)),-$(ROS))/bin

# Without bytecode, every process of the tests would compile all modules and tests again.
unexport PYTHONDONTWRITEBYTECODE

# What a sourced ROS installation or another workspace has set would mix their libraries with the wheels'.
unexport PYTHONPATH PYTHONHOME AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH
ifdef ROS_DISTRO
unexport LD_LIBRARY_PATH
endif

.PHONY: demo test test-all bench evidence evidence-check lint soak audit docs setup
.DEFAULT_GOAL := demo

demo: setup
	$(BIN)/midastouch demo

# The tests with these marks: not what takes long.
test: lint
	$(PYTEST) -m "$(TESTS)"

test-all: lint
	$(PYTEST)

# Speed of every stage, then run time against error on two of our objects: under a quarter of an hour on two cores.
bench: setup
	$(BIN)/midastouch bench --json out/bench.json
	$(BIN)/midastouch benchmark --objects handle_tool eyebolt --slides 4 --length 0.4 --seeds 2 --init paper \
		--variant front --jobs 2 --minutes 10 --json out/front.json
	$(BIN)/midastouch report out/bench.json out/front.json --out out/bench

# Every report that is of other code than today's, the most important first; goes on where it was stopped.
# make evidence ARGS=--list says what and how long; ARGS="--headline --minutes 180" is three hours.
evidence: setup
	$(BIN)/midastouch evidence $(ARGS)

# Before a release: fails while a headline figure is of other code than today's.
evidence-check: setup
	$(BIN)/midastouch evidence --check

# MINUTES of images at 60 Hz over the eyebolt, or over MESH, and as much of everything else; takes some times as long.
soak: setup
	SOAK_MINUTES=$(MINUTES) SOAK_MESH=$(MESH) SOAK_REPORT=out/soak.json $(BIN)/python -m pytest midastouch_tools/test/soak

# What is known against the pinned packages; asks the internet, from an environment of its own.
audit:
	$(PYTHON) -m venv out/audit
	out/audit/bin/pip install --quiet pip-audit==2.10.1
	out/audit/bin/pip-audit --require-hashes --disable-pip --requirement tools/requirements/lock_$(ROS).txt

# The documents and the reference of the Python packages as HTML, in out/docs.
docs: setup
	$(BIN)/python -m pip --disable-pip-version-check install --quiet --no-deps \
		--requirement tools/requirements/docs_lock.txt
	$(BIN)/properdocs build --quiet

lint: setup
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/clang-format --dry-run --Werror midastouch_kernels/src/*

setup:
	@ROS=$(ROS) $(PYTHON) tools/setup_workspace.py
