"""Imports of the processes of a batch, made once and then shared by all; no thread runs yet."""

import importlib
from contextlib import suppress

import duckdb  # noqa: F401

import ros_visualise.batch.task  # noqa: F401

with suppress(ImportError):
    importlib.import_module("pyapriltags")  # which `tag_detector` imports when it starts
