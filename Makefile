# make demo         sets everything up and plays the demo; ARGS='--port 8090'
# make test         sets everything up and runs all tests; TESTS=tests/core/test_rate.py runs these
# make test QUICK=1 runs the tests that need nothing but Python, in two minutes
# make test SEEDS=all repeats tests of random errors with all seeds, which takes longer
# make test-oldest  runs the tests with the oldest versions of all dependencies
# make docs        builds the documentation in docs/_build/html; LINKS=1 also checks its links to other sites
# make fuzz         gives damaged input to the commands; ARGS=--help lists its options
# make soak         runs the program for two hours and reports what grows
PYTHON ?= python3
# ROS 1 is packaged for the distribution's own python3 only.
ROS_PYTHON := $(if $(filter file,$(origin PYTHON)),/usr/bin/python3,$(PYTHON))
# The oldest supported one that is installed.
OLDEST_PYTHON ?= $(firstword $(wildcard $(HOME)/.pyenv/versions/3.1[0-9].*/bin/python3 \
	/usr/bin/python3.1[0-9]) $(PYTHON))
# The simulated camera's renderer, which a Debian without a desktop lacks.
OPENGL := libegl1 libgl1 libgl1-mesa-dri
# Without a terminal sudo does not ask for a password.
AS_ROOT := $(if $(filter 0,$(shell id -u)),,sudo $$(test -t 0 || printf %s -n))

.PHONY: demo test test-oldest docs fuzz soak clean

demo: .venv/.ready
	@.venv/bin/ros-visualise demo $(ARGS) || test $$? -eq 130  # which is Ctrl-C

# Folders of tests that need nothing but Python and take no longer than two minutes together.
QUICK_TESTS := tests/test_imports.py tests/test_documents.py $(addprefix tests/,core geometry \
	messages vision sources sinks plotting nodes lessons package)

# Tests of ROS and of pages wait for other processes half of their time: two more than 2 cores.
PARALLEL := -n 4 --dist loadfile --no-loadscope-reorder

# Collected once beside mypy, which compiles them for the processes that run them.
SELECTED = $(or $(TESTS),$(if $(QUICK),$(QUICK_TESTS)))

# The processes of the tests share the cores; threads of BLAS would only wait for each other.
export OPENBLAS_NUM_THREADS := 1

# Read by tests/seeds.py.
export SEEDS

# Hundreds of processes that tests start would compile the package, each for itself.
export PYTHONDONTWRITEBYTECODE :=

test: $(if $(QUICK),.venv-test/.quick,.venv-test/.ready)
	.venv-test/bin/ruff format --check
	.venv-test/bin/ruff check
	.venv-test/bin/mypy & .venv-test/bin/pytest --collect-only -qq $(SELECTED) >/dev/null; wait $$!
	.venv-test/bin/pytest $(PARALLEL) $(SELECTED)

# Without ROS, whose packages are the distribution's, and without the newest packages.
test-oldest: .venv-oldest/.ready
	.venv-oldest/bin/pytest $(PARALLEL) --ignore=tests/ros1 --ignore=tests/ros2 \
		--ignore=tests/test_newcomer.py $(TESTS)

# Warnings, such as a link that leads nowhere, are errors.
docs: .venv/.docs
	.venv/bin/sphinx-build -W --keep-going -q -d docs/_build/pages docs docs/_build/html
	$(if $(LINKS),.venv/bin/sphinx-build -W --keep-going -q -b linkcheck -d docs/_build/pages docs docs/_build/links)
	@echo 'built in docs/_build/html; to read it: .venv/bin/ros-visualise docs'

fuzz: .venv-test/.ready
	PYTHONPATH=tests:tests/sources/recordings .venv-test/bin/python -m fuzz $(ARGS)

soak: .venv-test/.ready
	.venv-test/bin/python benchmarks/soak/run.py $(ARGS) || test $$? -eq 130

.venv/.ready: pyproject.toml package.xml
	@echo 'setting up in .venv, which takes a few minutes ...'
	@$(call make_venv,$(PYTHON),.venv)
	@.venv/bin/pip install --quiet --disable-pip-version-check -e '.[headless,sim]' \
		>.venv/pip.log 2>&1 || { echo 'cannot install the Python packages, which takes a' \
		'network the first time; the reason is in .venv/pip.log' >&2; exit 1; }
	@.venv/bin/python -c '$(RENDER)' 2>/dev/null || $(call apt_install,$(OPENGL)) || true
	@touch $@

.venv/.docs: .venv/.ready tests/constraints.txt
	.venv/bin/pip install --quiet --disable-pip-version-check -c tests/constraints.txt \
		-e '.[headless,sim,detect,docs]'
	@touch $@

# With what the tests use beside Python, if it can be installed: a browser, a screen, FFmpeg, ROS 1.
.venv-test/.ready: pyproject.toml package.xml tests/constraints.txt tests/debian-packages.txt
	@$(if $(MISSING),$(call apt_install,$(MISSING)) || \
		{ echo 'the tests that need these are skipped'; test -z "$$CI"; })
	if $(ROS_PYTHON) -c 'import rospy' 2>/dev/null; then \
		$(call make_venv,$(ROS_PYTHON),--system-site-packages --clear .venv-test); \
	else \
		$(call make_venv,$(PYTHON),--clear .venv-test); \
	fi
	$(call install_for_tests,desktop)
	.venv-test/bin/python -c 'import cv2' 2>/dev/null || { .venv-test/bin/pip uninstall --quiet \
		--yes opencv-python; $(call install_for_tests,headless); }
	touch .venv-test/.quick $@

.venv-test/.quick: pyproject.toml package.xml tests/constraints.txt
	@$(call make_venv,$(PYTHON),--clear .venv-test)
	$(call install_for_tests,headless)
	touch $@

install_for_tests = .venv-test/bin/pip install --quiet --disable-pip-version-check \
	-c tests/constraints.txt -e '.[$(1),sim,detect,test]'

DEBIAN_PACKAGES = $(shell cat tests/debian-packages.txt)
MISSING = $(filter-out $(shell dpkg-query -W -f '$${db:Status-Status}=$${Package}\n' \
	$(DEBIAN_PACKAGES) 2>/dev/null | sed -n 's/^installed=//p'),$(DEBIAN_PACKAGES))

.venv-oldest/.ready: pyproject.toml package.xml
	$(call make_venv,$(OLDEST_PYTHON),--clear .venv-oldest)
	grep -oE '"[a-z][a-z0-9._-]*>=[0-9.]+' pyproject.toml | sed 's/"//; s/>=/==/' >.venv-oldest/floors
	.venv-oldest/bin/pip install --quiet --disable-pip-version-check \
		-c .venv-oldest/floors -e '.[headless,sim,detect,test]'
	touch $@

# Debian's python3 makes no environments until python3-venv is installed. The pip of Python 3.10 finds
# no end among the versions of the packages.
make_venv = $(1) -c '$(REQUIRED)' || exit 1; \
	$(1) -c 'import ensurepip' 2>/dev/null || $(call apt_install,python3-venv) || true; \
	$(1) -m venv $(2) && { $(lastword $(2))/bin/pip install --quiet --disable-pip-version-check \
	'pip>=26; python_version < "3.11"' >/dev/null 2>&1 || true; }

LEAST_PYTHON := $(shell sed -n 's/^requires-python = ">=3\.\([0-9]*\)"/\1/p' pyproject.toml)
REQUIRED := import sys; sys.exit(sys.version_info < (3, $(LEAST_PYTHON)) and "%s is Python %s, \
	older than 3.$(LEAST_PYTHON); name another one by PYTHON=..." % \
	(sys.executable, sys.version.split()[0]))

# Fails without a renderer.
RENDER := from ros_visualise.simulation.rendering import choose_backend; choose_backend()

# Installs Debian packages, or fails.
apt_install = { echo 'installing with apt-get: $(1)'; $(CAN_INSTALL) && \
	$(AS_ROOT) sh -c '$(INSTALL) $(1) || { apt-get update -q && $(INSTALL) $(1); }'; } || \
	{ echo 'not installed: $(1)'; false; }
CAN_INSTALL := command -v apt-get >/dev/null$(if $(AS_ROOT), && command -v sudo >/dev/null)
INSTALL := DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends

clean:
	rm -rf .venv .venv-test .venv-oldest
