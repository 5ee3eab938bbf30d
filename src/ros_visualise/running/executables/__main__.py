"""Prints the names of the executables, a line each."""

from ros_visualise.running.executables import names

print(*names(), sep="\n")
