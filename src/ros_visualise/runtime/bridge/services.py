"""Services of a node on a graph: its actions, and ``set_camera_info`` of our own cameras."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import partial

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.data import CameraInfo, Image
from ros_visualise.messages.calibrations import info_topic
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.middleware import Handle, Transport
from ros_visualise.sinks.files import save_again
from ros_visualise.sources.calibration import camera_name, check, path_of, save, to_yaml

log = logging.getLogger(__name__)

_PATIENCE_S = 2.0  # for the first image of a camera


def answer(act: Callable[[], str | None]) -> tuple[bool, str]:
    """Success of a service call, and its message.

    Args:
        act: does the work, and returns the message or raises the error to be reported.
    """
    try:
        return True, act() or ""
    except (RosVisualiseError, ValueError) as error:
        return False, str(error)
    except supervision.ERRORS as error:
        supervision.note("service", error)
        return False, f"failed: {type(error).__name__}: {error}"


def offer_actions(
    transport: Transport, runtime: LocalRuntime, namespaces: Mapping[str, str]
) -> list[Handle]:
    """Offer a std_srvs/Trigger service for each action of each node: ``~clear``, ``~land``.

    Args:
        transport: what they are offered on.
        runtime: what runs the nodes.
        namespaces: node name -> where its services are below this node's private namespace.
    """
    return [
        transport.offer(
            f"~{namespaces[node.name]}/{action}".replace("~/", "~"),
            partial(runtime.act, node.name, action),
        )
        for node in runtime.graph.members
        for action in node.type.actions
    ]


def offer_calibration(transport: Transport, runtime: LocalRuntime) -> list[Handle]:
    """Offer the service beside the images of a source that has a ``camera_info_url``."""
    source = runtime.graph.source
    if source is None or not hasattr(source.params, "camera_info_url"):
        return []
    topic = next(name for name, made in source.topics.items() if made.type is Image)
    service = f"{info_topic(topic).rpartition('/')[0]}/set_camera_info"
    return [transport.offer_calibration(service, CalibrationWriter(transport, runtime, topic).set)]


class CalibrationWriter:
    """Takes calibrations for the images of a topic, and writes them where the source reads them.

    Args:
        transport: gives the camera its name.
        runtime: runs the source.
        topic: of the source's images.
    """

    def __init__(self, transport: Transport, runtime: LocalRuntime, topic: str) -> None:
        self._name = camera_name(transport.resolve("~"))
        self._runtime = runtime
        self._topic = topic

    def set(self, info: CameraInfo) -> None:
        """Write a calibration to its file; the source's next image has it.

        A file that was named at the start is replaced, as camera_info_manager does; one that was
        named since is written as by `save_again`.

        Raises:
            UsageError: it is not a calibration of these images, or no file is named.
            OpenError: the file exists and must not be replaced.
            RecordingError: it cannot be written.
        """
        check(info, self._size())
        source = self._runtime.graph.source
        assert source is not None
        url = self._runtime.parameters[source.name].current.camera_info_url
        if not url:
            raise UsageError("no calibration file: set camera_info_url to file:///PATH")
        if url == source.params.camera_info_url:
            save(info, path_of(url), self._name)
        else:
            save_again(path_of(url), to_yaml(info, self._name).encode())
        log.info("%s: calibration written", url)

    def _size(self) -> tuple[int, int]:
        """Width and height of the images."""
        subscription = self._runtime.subscribe(self._topic)
        try:
            image = subscription.take(_PATIENCE_S)
        finally:
            subscription.close()
        if image is None:
            raise UsageError("no image yet, so the image size is unknown; try again")
        return image.width, image.height
