"""A real ROS 1 master for the tests, and processes of its graph."""

from __future__ import annotations

import os
import subprocess
import sys
import xmlrpc.client
from pathlib import Path
from typing import Any

from forked import Forked
from ports import free_port as free_port
from waiting import PATIENCE_S as PATIENCE_S
from waiting import wait_for as wait_for

from ros_visualise.running.executables import command_of


class Master:
    """A roscore of its own, and processes in its environment."""

    def __init__(self, folder: Path) -> None:
        port = free_port()
        self.uri = f"http://127.0.0.1:{port}"
        self.environment = {
            **os.environ,
            "PATH": f"/usr/bin:{os.environ['PATH']}",  # whose python3 the tools of ROS need
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(folder),
            "ROS_LOG_DIR": str(folder / "log"),
            "PYTHONUNBUFFERED": "1",
        }
        self.core = self.run("roscore", "-p", str(port))
        wait_for(self.answers, "roscore")
        self._at_first = set(self.parameters())

    def run(self, *command: str, **options: Any) -> subprocess.Popen[str]:
        """A process in this environment, with its output as text; forked if it is ours."""
        options = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, **options}
        kind = Forked if command[:2] == (sys.executable, "-c") else subprocess.Popen
        return kind(list(command), env=self.environment, text=True, **options)

    def call(self, *command: str, timeout_s: float = PATIENCE_S) -> str:
        """The output of a command that ends by itself."""
        done = subprocess.run(
            command, env=self.environment, text=True, capture_output=True, timeout=timeout_s
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def answers(self) -> bool:
        import rosgraph

        return bool(rosgraph.is_master_online(self.uri))

    def proxy(self) -> Any:
        return xmlrpc.client.ServerProxy(self.uri)

    def parameters(self) -> list[str]:
        _, _, names = self.proxy().getParamNames("/tests")
        return list(names)

    def forget(self) -> None:
        """Delete the parameters that nodes, launches and tests left: they outlive them."""
        for name in set(self.parameters()) - self._at_first:
            self.proxy().deleteParam("/tests", name)

    def stop(self) -> None:
        end(self.core)


def end(process: subprocess.Popen[str]) -> str:
    """Stop a process, if it still runs; all that it printed."""
    if process.poll() is None:
        process.terminate()
    try:
        return process.communicate(timeout=20)[0] or ""
    except subprocess.TimeoutExpired:
        process.kill()
        return process.communicate()[0] or ""


class Nodes:
    """Our executables as processes of a master's graph."""

    def __init__(self, master: Master) -> None:
        self._master = master
        self._started: dict[str, subprocess.Popen[str]] = {}

    def start(
        self, name: str, *args: str, node: str = "", wait: bool = True
    ) -> subprocess.Popen[str]:
        """``start("filters", "_gray:=false")``, and wait until it offers its parameters.

        ``node`` is its name on the graph where that is not the executable's.
        """
        process = self._master.run(*command_of(name), *args)
        given = [arg.removeprefix("__name:=") for arg in args if arg.startswith("__name:=")]
        node = f"/{(given or [node or name])[0]}"
        self._started[node] = process
        if wait:
            wait_for(lambda: self._is_ready(node, process), node)
        return process

    def stop(self) -> None:
        """End all of them, and forget their parameters, which outlive a node."""
        for process in self._started.values():
            process.terminate()
        for node, process in self._started.items():
            end(process)
            self._master.proxy().deleteParam("/tests", node)

    def _is_ready(self, node: str, process: subprocess.Popen[str]) -> bool:
        assert process.poll() is None, process.communicate()[0]
        _, _, (_, _, services) = self._master.proxy().getSystemState("/tests")
        return any(name.startswith(f"{node}/") and "set_parameters" in name for name, _ in services)


class Heard:
    """Everything that a stock subscriber gets."""

    def __init__(self, topic: str, message_class: Any) -> None:
        import rospy

        self.messages: list[Any] = []
        self.subscriber = rospy.Subscriber(topic, message_class, self.messages.append)

    def wait(self, count: int = 1) -> list[Any]:
        wait_for(lambda: len(self.messages) >= count, f"{count} of {self.subscriber.name}")
        return self.messages

    def since(self, stamp: Any) -> list[Any]:
        """Those of that time or later."""
        return [message for message in self.messages if message.header.stamp >= stamp]
