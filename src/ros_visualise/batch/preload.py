"""Modules that each process of a batch needs, loaded once and shared by all; no thread runs yet."""

import gc
import importlib
from contextlib import suppress

import numpy.ma  # noqa: F401 - which DuckDB imports when it reads an array

import ros_visualise.batch.task
import ros_visualise.sources.logs.tlog  # noqa: F401 - which a film looks for beside it
from ros_visualise.batch.tables import connect
from ros_visualise.graph import IMAGE_NODES

for name in (*IMAGE_NODES, "tag_detector"):  # a graph imports its nodes one by one
    importlib.import_module(f"ros_visualise.nodes.{name}")
with suppress(ImportError):
    importlib.import_module("pyapriltags")  # which `tag_detector` imports when it starts
connect().close()  # DuckDB's first connection takes twice as long as a later one
gc.freeze()  # a collection of garbage would copy what is shared
