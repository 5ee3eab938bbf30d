"""The service ``set_camera_info`` of our own cameras, as camera_info_manager has it."""

from __future__ import annotations

import logging

from ros_visualise.core.errors import UsageError
from ros_visualise.data import CameraInfo, Image
from ros_visualise.messages.calibrations import info_topic
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.middleware import Handle, Transport
from ros_visualise.sinks.files import save_again
from ros_visualise.sources.calibration import camera_name, check, path_of, save, to_yaml

log = logging.getLogger(__name__)

_PATIENCE_S = 2.0  # with a camera whose first image has not come


def offer_calibration(transport: Transport, runtime: LocalRuntime) -> list[Handle]:
    """The service beside the images of a source that has a ``camera_info_url``, if there is one."""
    source = runtime.graph.source
    if source is None or not hasattr(source.params, "camera_info_url"):
        return []
    topic = next(name for name, made in source.topics.items() if made.type is Image)
    service = f"{info_topic(topic).rpartition('/')[0]}/set_camera_info"
    return [transport.offer_calibration(service, Calibrator(transport, runtime, topic).set)]


class Calibrator:
    """Takes calibrations for the images of a topic, and keeps them where the source looks.

    Args:
        transport: what they come by.
        runtime: runs the source.
        topic: of the source's images.
    """

    def __init__(self, transport: Transport, runtime: LocalRuntime, topic: str) -> None:
        self._name = camera_name(transport.resolve("~"))
        self._runtime = runtime
        self._topic = topic

    def set(self, info: CameraInfo) -> None:
        """Keep a calibration; the source's next image has it.

        It replaces that in the file which was named at the start, as camera_info_manager does; a
        file that was named since is written as `save_again` does.

        Raises:
            UsageError: it is not a calibration of these images, or there is no place for it.
            OpenError: the file is there and not to be replaced.
            RecordingError: it cannot be written.
        """
        check(info, self._size())
        source = self._runtime.graph.source
        assert source is not None
        url = self._runtime.parameters[source.name].current.camera_info_url
        if not url:
            raise UsageError("there is no file to write it to: set camera_info_url to file:///PATH")
        if url == source.params.camera_info_url:
            save(info, path_of(url), self._name)
        else:
            save_again(path_of(url), to_yaml(info, self._name).encode())
        log.info("%s: the calibration was written", url)

    def _size(self) -> tuple[int, int]:
        """Width and height of the images."""
        subscription = self._runtime.subscribe(self._topic)
        try:
            image = subscription.take(_PATIENCE_S)
        finally:
            subscription.close()
        if image is None:
            raise UsageError("no image has come yet, so their size is not known: try again")
        return image.width, image.height
