"""A declaration with wrong parameters or topics is answered by what to write."""

from dataclasses import dataclass

import pytest

from ros_visualise.core.errors import UsageError
from ros_visualise.core.synchronizer import Exact
from ros_visualise.data import Image
from ros_visualise.nodes import node, param


@dataclass
class Changeable:
    low: int = param(1, "threshold", min=0, max=9)


class NoDataclass:
    low = 1


@dataclass(frozen=True)
class Plain:
    low: int = 1


@dataclass(frozen=True)
class TooLarge:
    low: int = param(10, "threshold", min=0, max=9)


@dataclass(frozen=True)
class WrongType:
    low: int = param(0.5, "threshold")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            {"params": Changeable},
            "node own: Changeable is not frozen; write @dataclass(frozen=True) above it",
        ),
        (
            {"params": NoDataclass},
            "node own: params=NoDataclass is not a dataclass; write @dataclass(frozen=True) above"
            " it",
        ),
        ({"params": Plain}, "node own: Plain.low: write low: TYPE = param(DEFAULT, HELP)"),
        (
            {"params": TooLarge},
            "node own: TooLarge: the default low=10: must be from 0 to 9",
        ),
        (
            {"params": WrongType},
            "node own: WrongType: the default low=0.5: must be a whole number",
        ),
        ({"topics": {"image": ""}}, "node own: topics={'image': ''}: invalid topic name;"),
        ({"topics": {"image": "/a b"}}, "node own: topics={'image': '/a b'}: invalid topic name"),
        ({"topics": {"edges": "/a"}}, "node own: no output 'edges'; choose from image"),
    ],
)
def test_declarations(options, says):
    with pytest.raises(UsageError) as raised:
        node("own", inputs={"image": Image}, outputs={"image": Image}, **options)
    assert str(raised.value).startswith(says)


def test_the_former_name_of_sync_is_taken_with_a_warning():
    ports = {"one": Image, "other": Image}
    with pytest.warns(FutureWarning, match="node own: join= is deprecated; use sync="):
        declare = node("own", inputs=ports, outputs={"image": Image}, join=Exact())
    assert declare(lambda one, other, params: one).declared.sync == Exact()
