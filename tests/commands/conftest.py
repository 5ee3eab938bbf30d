"""Commands as a person runs them."""

import logging

import pytest

from ros_visualise.commands import main


@pytest.fixture
def run(monkeypatch, capsys, caplog):
    """Run a command; its exit status and what it said of errors."""
    monkeypatch.setattr("signal.signal", lambda *_: None)
    caplog.set_level(logging.INFO, "ros_visualise")  # which a command sets, and nobody sets back

    def run(*arguments):
        status = main([*map(str, arguments)])
        return status, capsys.readouterr().err

    return run
