"""Python processes that begin with the package imported, which takes most of their time.

A server imports it once for each process of the tests, and is forked for each process that a test
starts. Such a process has its own id, arguments, environment, streams, signals and exit status;
how Python and the package start is tested with real ones.
"""

from __future__ import annotations

import array
import atexit
import contextlib
import functools
import gc
import importlib
import json
import os
import selectors
import signal
import socket
import subprocess
import sys
from typing import Any

_IMPORTED = (
    "ros_visualise.__main__",
    "ros_visualise.commands",
    "ros_visualise.graph.pipelines",
    "ros_visualise.messages.recorded",
    "ros_visualise.nodes.streamer",
    "ros_visualise.running.executables.execution",
    "ros_visualise.running.play",
    "ros_visualise.runtime.middleware",
    "xmlrpc.server",
)
"""None of rospy, which looks at arguments and the environment when it is imported."""
_OPTIONAL = (
    "ros_visualise.ui.page.server",
    "catkin_pkg.packages",
    "genpy",
    "sensor_msgs.msg",
    "std_msgs.msg",
)
_MOST_BYTES = 1 << 18


_PROGRAM = """
import runpy
import sys

del sys.modules["ros_visualise.__main__"]
runpy.run_module("ros_visualise", run_name="__main__", alter_sys=True)
"""


def run(command: list[Any], **options: Any) -> subprocess.CompletedProcess[str]:
    """As `subprocess.run` with text, whose outputs are taken."""
    timeout = options.pop("timeout", None)
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options}
    with Forked(list(map(str, command)), **given) as process:
        try:
            out, err = process.communicate(timeout=timeout)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(command, process.returncode, out, err)


class Forked(subprocess.Popen):  # type: ignore[type-arg]
    """As Popen, for ``[sys.executable, "-c", CODE, ...]``, and with ``"-m", "ros_visualise"``."""

    def _execute_child(self, args: Any, executable: Any, *more: Any) -> None:
        _, _, _, cwd, env, _, _, _, p2cread, p2cwrite, c2pread, c2pwrite, errread, errwrite = more[
            :14
        ]
        python, option, code, *rest = args
        assert python == sys.executable
        assert option == "-c" or code == "ros_visualise"
        code = code if option == "-c" else _PROGRAM
        ours, theirs = socket.socketpair()
        self._status = ours
        cwd, env = os.path.abspath(cwd or "."), dict(os.environ if env is None else env)
        request = {"code": code, "argv": [option, *rest], "cwd": cwd, "env": env}
        with theirs, open(os.devnull) as nothing:
            given = p2cread, c2pwrite, errwrite
            own = nothing.fileno(), 1, 2
            streams = [own[n] if file < 0 else file for n, file in enumerate(given)]
            _send(_server(), request, [*streams, theirs.fileno()])
        ours.setblocking(True)  # whatever rospy has made the default
        self.pid = int.from_bytes(ours.recv(4), "little")
        self._child_created = True
        self._close_pipe_fds(p2cread, p2cwrite, c2pread, c2pwrite, errread, errwrite)

    def __exit__(self, kind: Any, *more: Any) -> None:
        if kind:  # or it would be waited for
            self.kill()
        super().__exit__(kind, *more)

    def _try_wait(self, wait_flags: int) -> tuple[int, int]:
        self._status.setblocking(not wait_flags & os.WNOHANG)
        try:
            status = self._status.recv(4)
        except BlockingIOError:
            return 0, 0
        self._status.close()
        return self.pid, int.from_bytes(status, "little")

    def _internal_poll(self, *_: Any, **__: Any) -> int | None:
        if self.returncode is None and self._waitpid_lock.acquire(False):
            try:
                pid, status = self._try_wait(os.WNOHANG) if self.returncode is None else (0, 0)
                if pid:
                    self._handle_exitstatus(status)
            finally:
                self._waitpid_lock.release()
        return self.returncode


@functools.cache
def _server() -> socket.socket:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in (ours, theirs):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _MOST_BYTES)
    with theirs:
        process = subprocess.Popen(
            [sys.executable, __file__, str(theirs.fileno())],
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            pass_fds=[theirs.fileno()],
        )
    atexit.register(lambda: (ours.close(), process.wait()))
    return ours


def _send(to: socket.socket, message: dict[str, Any], files: list[int]) -> None:
    given = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", files))]
    to.sendmsg([json.dumps(message).encode()], given)


def _receive(source: socket.socket) -> tuple[dict[str, Any] | None, list[int]]:
    size = socket.CMSG_SPACE(4 * 4)
    data, given, _, _ = source.recvmsg(_MOST_BYTES, size)
    files = array.array("i")
    for *_, one in given:
        files.frombytes(one)
    return (json.loads(data) if data else None), list(files)


def _serve(source: socket.socket) -> str:
    """Serve until the tests end; in each process, the code that it is to run."""
    waiting = selectors.DefaultSelector()
    waiting.register(source, selectors.EVENT_READ)
    while True:
        for key, _ in waiting.select():
            if key.fileobj is not source:
                pid, status = key.data
                waiting.unregister(key.fileobj)
                os.close(key.fd)
                with status, contextlib.suppress(OSError):  # nobody waits any more
                    status.send(os.waitpid(pid, 0)[1].to_bytes(4, "little"))
                continue
            request, files = _receive(source)
            if request is None:
                os._exit(0)
            pid = os.fork()
            if not pid:
                return _begin(request, files)
            status = socket.socket(fileno=files.pop())
            status.send(pid.to_bytes(4, "little"))
            waiting.register(os.pidfd_open(pid), selectors.EVENT_READ, (pid, status))
            for file in files:
                os.close(file)


def _begin(request: dict[str, Any], files: list[int]) -> str:
    for number in range(3):
        os.dup2(files[number], number)
    os.closerange(3, 1024)
    os.chdir(request["cwd"])
    os.environ.clear()
    os.environ.update(request["env"])
    sys.argv[:] = request["argv"]
    return str(request["code"])


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C of the tests
    for name in _IMPORTED:
        importlib.import_module(name)
    for name in _OPTIONAL:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    gc.freeze()
    _code = _serve(socket.socket(fileno=int(sys.argv[1])))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    exec(compile(_code, "<string>", "exec"), {"__name__": "__main__"})
