"""Running ONNX files by onnxruntime, with limited resources.

Files come from anywhere: they may lie about their size, request all memory, or refer to weights in
other files.
"""

from __future__ import annotations

import importlib
import io
import mmap
import re
import sys
from contextlib import redirect_stdout, suppress
from enum import Enum
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from ros_visualise.core import limits
from ros_visualise.core.errors import OpenError, RosVisualiseError, TooLarge
from ros_visualise.core.regular_files import open_file
from ros_visualise.landmarks.networks.gpus import gpus
from ros_visualise.landmarks.networks.layouts.own import ROWS
from ros_visualise.landmarks.networks.stopping import stoppable

_INSTALL = f"{sys.executable} -m pip install onnxruntime"
_FATAL = 4  # log level of onnxruntime: failures are raised too
_NO_MEMORY = "is smaller than requested bytes"
_LONGEST_WORD = 200
_CUDA = {
    "use_tf32": "0",  # 10 bits of the numbers, where results shall be those of the CPU
    "cudnn_conv_algo_search": "HEURISTIC",  # a search would be made for each size of a batch
}
_ROWS, _ROWS_OF_IMAGE = 24, 8  # at least, and for each of several images: most have fewer objects
_CUDA_FAILURE = re.compile(r"CUDA (?:failure|error)[^:]*: ([^;\n]{1,80})")
_GPU_HINT = (
    "check nvidia-smi, install the libraries (pip install 'onnxruntime-gpu[cuda,cudnn]'), or set"
    " provider=cpu"
)
_LOCATION = re.compile(rb"\x0a\x08location\x12([\x80-\xff]?)([\x00-\x7f])")
"""Protobuf key and length of its value, in groups of seven bits, the lowest first."""


class Provider(Enum):
    """Hardware that runs a network."""

    CPU = "cpu"
    CUDA = "cuda"


def is_available(provider: Provider) -> bool:
    """True if this machine has the hardware, and the installed onnxruntime supports it."""
    with suppress(OpenError):
        return _is_supported(provider) and (provider is Provider.CPU or gpus() > 0)
    return False


def _is_supported(provider: Provider) -> bool:
    return _provider_name(provider) in _load_onnxruntime().get_available_providers()


class TensorPort(NamedTuple):
    """An input or output; free sides of its shape are None or have a name."""

    name: str
    type: str
    shape: tuple[int | str | None, ...]


class Session(Protocol):
    """A loaded ONNX file, here or in another process; as `OnnxSession`."""

    path: str
    inputs: tuple[TensorPort, ...]
    optional: tuple[TensorPort, ...]
    outputs: tuple[TensorPort, ...]
    metadata: dict[str, str]

    def run(self, inputs: dict[str, Any], names: list[str]) -> list[Any]: ...


class OnnxSession:
    """A loaded ONNX file.

    Args:
        path: the file.
        provider: hardware to run on.
        threads: number of threads per image.
        gpu: number of the GPU, if the provider has several.

    Attributes:
        inputs: required inputs.
        optional: optional inputs.
        outputs: the outputs.
        metadata: texts in the file.

    Raises:
        OpenError: no such file, not ONNX, too large, or onnxruntime is missing or cannot run it.
    """

    def __init__(self, path: str, provider: Provider, threads: int, gpu: int = 0) -> None:
        self.path = path
        self._runtime = _load_onnxruntime()
        _check_file(path)
        options = self._options(threads)
        name = self._find(provider)
        settings: dict[str, Any] = {}
        if provider is Provider.CUDA:
            settings = {"device_id": gpu, **_CUDA}
            _load_cuda(self._runtime)
        try:
            with stoppable(partial(_cancel, options)):
                self._session = self._runtime.InferenceSession(
                    path, options, [(name, settings)], enable_fallback=False
                )
            self.metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
            self.inputs = tuple(map(_port, self._session.get_inputs()))
            self.optional = tuple(map(_port, self._session.get_overridable_initializers()))
            self.outputs = tuple(map(_port, self._session.get_outputs()))
        except _errors() as error:  # including names that are not valid text
            if failure := _CUDA_FAILURE.search(str(error)):
                raise OpenError(f"provider={provider.value}: {failure[1]}; {_GPU_HINT}") from None
            raise OpenError(f"{path}: {_short(error)}; give an ONNX file") from None
        is_padded = any(one.name == ROWS for one in self.optional)
        self._pads = is_padded and provider is Provider.CUDA
        if name not in self._session.get_providers():  # onnxruntime takes the CPU in its place
            raise OpenError(f"provider={provider.value}: no usable GPU; {_GPU_HINT}")

    def run(self, inputs: dict[str, Any], names: list[str]) -> list[Any]:
        """The outputs of these names.

        Raises:
            RosVisualiseError: the network fails on this input.
        """
        options = self._runtime.RunOptions()
        if self._pads:
            images = max(len(one) for one in inputs.values())
            rows = max(_ROWS, _ROWS_OF_IMAGE * images)
            inputs = {**inputs, ROWS: np.array([rows], np.int64)}
        try:
            with stoppable(partial(setattr, options, "terminate", True)):
                outputs: list[Any] = self._session.run(names, inputs, options)
        except _errors() as error:
            raise RosVisualiseError(f"{self.path}: {_short(error)}") from None
        return outputs

    def _find(self, provider: Provider) -> str:
        if not _is_supported(provider):
            raise OpenError(
                f"provider={provider.value}: the installed onnxruntime does not support it;"
                " replace it (pip install 'onnxruntime-gpu[cuda,cudnn]'), or set provider=cpu"
            )
        return _provider_name(provider)

    def _options(self, threads: int) -> Any:
        _limit_memory()
        options = self._runtime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.log_severity_level = _FATAL
        # busy-waiting threads would starve the page
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        options.add_session_config_entry("session.use_env_allocators", "1")
        return options


def _provider_name(provider: Provider) -> str:
    return f"{provider.value.upper()}ExecutionProvider"


def _load_cuda(runtime: Any) -> None:
    """Load NVIDIA's libraries from pip's packages, where these are installed."""
    if hasattr(runtime, "preload_dlls"):  # from 1.21 on; it prints what is missing
        with redirect_stdout(io.StringIO()):
            runtime.preload_dlls()


def _cancel(options: Any) -> None:
    """Stop loading a file; supported by onnxruntime 1.21 and later."""
    if hasattr(options, "set_load_cancellation_flag"):
        options.set_load_cancellation_flag(True)


def _port(found: Any) -> TensorPort:
    return TensorPort(found.name, found.type, tuple(found.shape))


def _load_onnxruntime() -> Any:
    try:
        runtime = importlib.import_module("onnxruntime")
    except ImportError as error:
        raise OpenError(f"networks need onnxruntime ({error}): {_INSTALL}") from None
    runtime.set_default_logger_severity(_FATAL)
    return runtime


@cache
def _limit_memory() -> None:
    """Limit the memory of all networks in this process together to that of one input."""
    runtime = _load_onnxruntime()
    info = runtime.OrtMemoryInfo(
        "Cpu", runtime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, runtime.OrtMemType.DEFAULT
    )
    its_own = -1
    arena = runtime.OrtArenaCfg(limits.max_memory(), its_own, its_own, its_own)
    with suppress(*_errors()):  # a limit is already set in this process
        runtime.create_and_register_allocator(info, arena)


@cache
def _errors() -> tuple[type[Exception], ...]:
    """Exceptions of onnxruntime, which have no base class of their own."""
    module = importlib.import_module("onnxruntime.capi.onnxruntime_pybind11_state")
    found = [one for one in vars(module).values() if isinstance(one, type)]
    own = [one for one in found if issubclass(one, Exception)]
    return (*own, RuntimeError, ValueError, MemoryError)


def _short(error: Exception) -> str:
    """The first line of an onnxruntime error, without its codes."""
    if _NO_MEMORY in str(error):
        return f"needs more than {limits.max_memory() >> 20} MiB of memory; raise --max-memory"
    lines = str(error).strip().splitlines() or [type(error).__name__]
    words = re.sub(r"^\[ONNXRuntimeError\] : \d+ : (\w+) : ", r"\1: ", lines[0])
    words = "".join(letter for letter in words if letter.isprintable())
    return words if len(words) <= _LONGEST_WORD else f"{words[:_LONGEST_WORD]} ..."


def _check_file(path: str) -> None:
    """Check a file before loading: its size, and the files with its weights."""
    file = Path(path)
    if not file.is_file():
        raise OpenError.missing(path, "give the ONNX file of a network")
    try:
        limits.check_model(file.stat().st_size)
        with open_file(file) as opened:
            if file.stat().st_size == 0:
                raise OpenError(f"{path}: empty; give an ONNX file")
            with mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as data:
                names = {_value(data, at) for at in _LOCATION.finditer(data)}
        for name in names:
            _check_weights(file, name.decode(errors="replace"))
    except TooLarge as error:
        raise OpenError(f"{path}: {error}") from None
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror}") from None


def _value(data: mmap.mmap, at: re.Match[bytes]) -> bytes:
    """The value after a key and its length."""
    length = at[2][0] << 7 | at[1][0] & 0x7F if at[1] else at[2][0]
    return data[at.end() : at.end() + length]


def _check_weights(file: Path, name: str) -> None:
    """Check a file of weights beside the network's file."""
    folder = file.resolve().parent
    weights = (folder / name).resolve()
    if not weights.is_relative_to(folder):
        raise OpenError(f"{file}: refers to weights in {name}, which is not in its folder")
    if not weights.is_file():
        raise OpenError.missing(folder / name, f"it should hold the weights of {file.name}")
    limits.check_model(weights.stat().st_size)
