# `make demo` sets everything up and plays the demo; `make test` sets everything up and tests it.
# make demo ARGS='--port 8090'; make test TESTS=tests/test_rate.py
PYTHON ?= python3
APT := $(if $(filter 0,$(shell id -u)),,sudo) apt-get

.PHONY: demo test clean

demo: .venv/.ready
	@.venv/bin/ros-visualise demo $(ARGS) || test $$? -eq 130  # which is Ctrl-C

test: .venv-test/.ready
	.venv-test/bin/ruff format --check
	.venv-test/bin/ruff check
	.venv-test/bin/mypy
	.venv-test/bin/pytest $(TESTS)

.venv/.ready: pyproject.toml package.xml
	@echo 'setting up, which takes a minute or so ...'
	$(call make_venv,.venv)
	.venv/bin/pip install --quiet --disable-pip-version-check -e '.[headless]'
	touch $@

.venv-test/.ready: pyproject.toml package.xml tests/constraints.txt tests/debian-packages.txt
	sh tests/install-debian-packages.sh
	$(call make_venv,.venv-test)
	.venv-test/bin/pip install --quiet --disable-pip-version-check \
		-c tests/constraints.txt -e '.[desktop,test]'
	touch $@

# Debian's python3 has no venv module until python3-venv is installed.
make_venv = $(PYTHON) -m venv $(1) || { $(APT) install -y python3-venv && $(PYTHON) -m venv $(1); }

clean:
	rm -rf .venv .venv-test
