"""Imports of the processes of a batch, made once and then shared by all; no thread runs yet."""

import duckdb  # noqa: F401

import ros_visualise.batch.task  # noqa: F401
