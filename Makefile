# `make demo` sets everything up and plays the demo; `make test` sets everything up and tests it.
# `make fuzz` gives damaged input to the commands; ARGS=--help tells how.
# `make soak` runs the program for two hours and tells whether anything of it grows.
# make demo ARGS='--port 8090'; make test TESTS=tests/test_rate.py
PYTHON ?= python3
# ROS 1 is there for the distribution's own python3 alone.
ROS_PYTHON := $(if $(filter file,$(origin PYTHON)),/usr/bin/python3,$(PYTHON))
# What the simulated camera draws with; a Debian without a desktop lacks it. Others may have their
# own, so that it is no error where it cannot be installed.
OPENGL := libegl1 libgl1 libgl1-mesa-dri
APT := $(if $(filter 0,$(shell id -u)),,sudo) apt-get

.PHONY: demo test fuzz soak clean

demo: .venv/.ready
	@.venv/bin/ros-visualise demo $(ARGS) || test $$? -eq 130  # which is Ctrl-C

test: .venv-test/.ready
	.venv-test/bin/ruff format --check
	.venv-test/bin/ruff check
	.venv-test/bin/mypy
	.venv-test/bin/pytest -n 2 --dist loadfile $(TESTS)

fuzz: .venv-test/.ready
	PYTHONPATH=tests:tests/sources/recordings .venv-test/bin/python -m fuzz $(ARGS)

soak: .venv-test/.ready
	.venv-test/bin/python benchmarks/soak/run.py $(ARGS) || test $$? -eq 130

.venv/.ready: pyproject.toml package.xml
	@echo 'setting up, which takes a minute or so ...'
	-! command -v apt-get >/dev/null || dpkg -s $(OPENGL) >/dev/null 2>&1 || \
		$(APT) install -y --no-install-recommends $(OPENGL)
	$(call make_venv,$(PYTHON),.venv)
	.venv/bin/pip install --quiet --disable-pip-version-check -e '.[headless,sim]'
	touch $@

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

# Debian's python3 has no venv module until python3-venv is installed.
make_venv = $(1) -m venv $(2) || { $(APT) install -y python3-venv && $(1) -m venv $(2); }

clean:
	rm -rf .venv .venv-test
