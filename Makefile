# `make demo` sets everything up and plays the demo; `make test` sets everything up and tests it.
# `make fuzz` gives damaged input to the commands; ARGS=--help tells how.
# `make soak` runs the program for two hours and tells whether anything of it grows.
# `make test-oldest` runs the tests with the oldest versions of all dependencies that are allowed.
# make demo ARGS='--port 8090'; make test TESTS=tests/test_rate.py
PYTHON ?= python3
# ROS 1 is there for the distribution's own python3 alone.
ROS_PYTHON := $(if $(filter file,$(origin PYTHON)),/usr/bin/python3,$(PYTHON))
# The oldest one at hand that is supported.
OLDEST_PYTHON ?= $(firstword $(wildcard $(HOME)/.pyenv/versions/3.1[0-9].*/bin/python3 \
	/usr/bin/python3.1[0-9]) $(PYTHON))
# What the simulated camera draws with, where a Debian without a desktop has nothing for it.
OPENGL := libegl1 libgl1 libgl1-mesa-dri
# Nobody is asked for a password who is not there to give it.
AS_ROOT := $(if $(filter 0,$(shell id -u)),,sudo $$(test -t 0 || printf %s -n))

.PHONY: demo test test-oldest fuzz soak clean

demo: .venv/.ready
	@.venv/bin/ros-visualise demo $(ARGS) || test $$? -eq 130  # which is Ctrl-C

test: .venv-test/.ready
	.venv-test/bin/ruff format --check
	.venv-test/bin/ruff check
	.venv-test/bin/mypy
	.venv-test/bin/pytest -n 2 --dist loadfile $(TESTS)

# Without those of ROS, whose packages are a distribution's, and of the newest packages.
test-oldest: .venv-oldest/.ready
	.venv-oldest/bin/pytest -n 2 --dist loadfile --ignore=tests/ros1 --ignore=tests/ros2 \
		--ignore=tests/test_newcomer.py $(TESTS)

fuzz: .venv-test/.ready
	PYTHONPATH=tests:tests/sources/recordings .venv-test/bin/python -m fuzz $(ARGS)

soak: .venv-test/.ready
	.venv-test/bin/python benchmarks/soak/run.py $(ARGS) || test $$? -eq 130

.venv/.ready: pyproject.toml package.xml
	@echo 'setting up in .venv, which takes a minute or so ...'
	@$(call make_venv,$(PYTHON),.venv)
	@.venv/bin/pip install --quiet --disable-pip-version-check -e '.[headless,sim]' \
		>.venv/pip.log 2>&1 || { echo 'cannot install the Python packages, which takes a' \
		'network the first time; the reason is in .venv/pip.log' >&2; exit 1; }
	@.venv/bin/python -c '$(RENDER)' 2>/dev/null || { $(call apt_install,$(OPENGL)); }
	@touch $@

.venv-test/.ready: pyproject.toml package.xml tests/constraints.txt tests/debian-packages.txt
	sh tests/install-debian-packages.sh
	if $(ROS_PYTHON) -c 'import rospy' 2>/dev/null; then \
		$(call make_venv,$(ROS_PYTHON),--system-site-packages --clear .venv-test); \
	else \
		$(call make_venv,$(PYTHON),--clear .venv-test); \
	fi
	.venv-test/bin/pip install --quiet --disable-pip-version-check \
		-c tests/constraints.txt -e '.[desktop,sim,detect,test]'
	touch $@

.venv-oldest/.ready: pyproject.toml package.xml
	$(call make_venv,$(OLDEST_PYTHON),--clear .venv-oldest)
	grep -oE '"[a-z][a-z0-9._-]*>=[0-9.]+' pyproject.toml | sed 's/"//; s/>=/==/' >.venv-oldest/floors
	.venv-oldest/bin/pip install --quiet --upgrade pip  # that of Python 3.10 finds no end
	.venv-oldest/bin/pip install --quiet --disable-pip-version-check \
		-c .venv-oldest/floors -e '.[headless,sim,detect,test]'
	touch $@

# Debian's python3 makes no environments until python3-venv is installed.
make_venv = $(1) -c '$(REQUIRED)' || exit 1; \
	$(1) -c 'import ensurepip' 2>/dev/null || { $(call apt_install,python3-venv); }; \
	$(1) -m venv $(2)

LEAST_PYTHON := $(shell sed -n 's/^requires-python = ">=3\.\([0-9]*\)"/\1/p' pyproject.toml)
REQUIRED := import sys; sys.exit(sys.version_info < (3, $(LEAST_PYTHON)) and "%s is Python %s, \
	older than 3.$(LEAST_PYTHON); name another one by PYTHON=..." % \
	(sys.executable, sys.version.split()[0]))

# Whether there is anything to draw with.
RENDER := from ros_visualise.simulation.rendering import choose_backend; choose_backend()

# Where packages cannot be installed, what needs them goes without, or says what it lacks.
apt_install = echo 'to be installed by apt-get: $(1)'; \
	{ $(CAN_INSTALL) && $(AS_ROOT) sh -c '$(INSTALL) $(1) || { apt-get update -q && $(INSTALL) $(1); }'; } \
	|| echo 'not installed: $(1)'
CAN_INSTALL := command -v apt-get >/dev/null$(if $(AS_ROOT), && command -v sudo >/dev/null)
INSTALL := apt-get install -q -y --no-install-recommends

clean:
	rm -rf .venv .venv-test .venv-oldest
