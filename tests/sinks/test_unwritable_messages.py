"""One message that cannot be written is refused by one error of ours; the others are written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import (
    CompressedImage,
    Header,
    Image,
    Marker,
    MarkerArray,
    Number,
    PoseStamped,
    Text,
    Transforms,
    TransformStamped,
)
from ros_visualise.data import Path as PathMessage
from ros_visualise.messages.definitions import Encoding
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder
from ros_visualise.sinks.encoding import Encoder

ORIGIN, UNTURNED = np.zeros(3), np.array([0.0, 0, 0, 1])
PIXELS = np.zeros((2, 2), np.uint8)
BAD = {
    "a number for a text": (Text(7), r"std_msgs/msg/String.data: 7 is not a valid string"),
    "nothing for a text": (Text(None), r"String.data: None is not a valid string"),
    "half a letter": (Text("\ud800"), r"String.data: '\\ud800' is not a valid string"),
    "a text for a number": (Number("x"), r"Float64.data: 'x' is not a valid float64"),
    "too large": (Marker(0, id=2**40), r"Marker.id: 1099511627776 is not a valid int32"),
    "in an array": (
        MarkerArray((Marker(0), Marker(0, id=-(2**31) - 1))),
        r"MarkerArray.markers\[1\].id: -2147483649 is not a valid int32",
    ),
    "not a marker": (MarkerArray((7,)), r"MarkerArray: 'int' object has no attribute"),
    "a frame without a name": (
        Transforms((TransformStamped(3, ORIGIN, UNTURNED),)),
        r"TFMessage.transforms\[0\].child_frame_id: 3 is not a valid string",
    ),
    "a negative stamp": (PoseStamped(ORIGIN, UNTURNED, Header(-5)), "a stamp of -1 s"),
    "a stamp past 2038": (PoseStamped(ORIGIN, UNTURNED, Header(2**62)), "a stamp of 4611686018 s"),
    "no header": (PoseStamped(ORIGIN, UNTURNED, None), "PoseStamped: 'NoneType' object"),
    "an image's header": (Image(PIXELS, "mono8", 3), "Image: 'int' object has no attribute"),
    "an image's frame": (
        Image(PIXELS, "mono8", Header(1, 9)),
        "Image.header.frame_id: 9 is not a valid string",
    ),
    "a compressed image": (CompressedImage(PIXELS[0], 8), "CompressedImage.format: 8"),
    "poses of a path": (
        PathMessage(np.array([-7]), np.zeros((1, 3)), np.zeros((1, 4))),
        "a stamp of -1 s",
    ),
    "a number": (7, "7 is not a message"),
    "a text": ("hello", "'hello' is not a message"),
    "nothing": (None, "None is not a message"),
}


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
@pytest.mark.parametrize(("message", "why"), BAD.values(), ids=BAD)
def test_it_is_refused_with_the_field_that_is_wrong(
    message: Any, why: str, encoding: Encoding
) -> None:
    encoder = Encoder(encoding)
    for write in (encoder.encode, encoder.parts):
        with pytest.raises(DamagedMessage, match=why):
            write(message)


@pytest.mark.parametrize("name", ["r.mcap", "r.bag", "folder"])
def test_others_are_written_before_and_after_it(name: str, tmp_path: Path) -> None:
    topics = {"/text": TopicType(Text.type_name), "/markers": TopicType(Marker.type_name)}
    with open_recorder(str(tmp_path / name), topics) as recorder:
        for number in range(9):
            is_bad = number % 3 == 1
            header = Header(10**9 * (number + 1), "map")
            for topic, message in (
                ("/text", Text(number if is_bad else f"{number}", header)),
                ("/markers", Marker(0, id=2**40 if is_bad else number, header=header)),
            ):
                if is_bad:
                    with pytest.raises(DamagedMessage):
                        recorder.write(topic, message)
                else:
                    recorder.write(topic, message)
    with AnyReader([tmp_path / name]) as reader:
        read = [
            (one.topic, stamp_ns // 10**9, reader.deserialize(raw, one.msgtype))
            for one, stamp_ns, raw in reader.messages()
        ]
    good = [0, 2, 3, 5, 6, 8]
    assert [m.data for t, _, m in read if t == "/text"] == [f"{number}" for number in good]
    assert [m.id for t, _, m in read if t == "/markers"] == good


def test_a_video_refuses_what_is_no_image(tmp_path: Path) -> None:
    with open_recorder(tmp_path / "v.mp4", {"/i": TopicType(Image.type_name)}) as recorder:
        for number in range(3):
            with pytest.raises(DamagedMessage, match="cannot be encoded as video"):
                recorder.write("/i", Text("hello"))
            recorder.write("/i", Image(PIXELS, "mono8", Header(number * 10**8)))
    assert (tmp_path / "v.mp4").stat().st_size > 0


def test_an_image_without_pixels_is_refused_also_as_the_first_of_a_video(tmp_path: Path) -> None:
    with open_recorder(tmp_path / "v.mp4", {"/i": TopicType(Image.type_name)}) as recorder:
        for number in range(3):
            with pytest.raises(DamagedMessage, match="an image of 0x2 has no pixels"):
                recorder.write("/i", Image(PIXELS[:, :0], "mono8"))
            recorder.write("/i", Image(PIXELS, "mono8", Header(number * 10**8)))
    assert (tmp_path / "v.mp4").stat().st_size > 0
