"""What detections in images and in space have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

from ros_visualise.core.message import Message
from ros_visualise.data.fields import Fields, field_names, header, read_header
from ros_visualise.data.header import Header
from ros_visualise.data.hypotheses import NO_HYPOTHESIS, Hypothesis

A = TypeVar("A", bound="FoundArray")


class Found:
    """A detected thing; ``id`` is the same for the same thing at other times."""

    hypotheses: tuple[Hypothesis, ...]
    id: str

    def fields(self, found_in: Header) -> dict[str, Any]:
        """The fields of the message's part for it, with the header of the array."""
        raise NotImplementedError

    @classmethod
    def read(cls, message: Any) -> Any:
        """The thing in such a part."""
        raise NotImplementedError

    @property
    def label(self) -> str:
        """What a person reads of it: class, score and id, as far as they are known.

        A tag's class ends with its id already.
        """
        score = f"{self.score:.2f}" if self.hypotheses else ""
        said = self.class_id == self.id or self.class_id.endswith(f"_{self.id}")
        number = f"#{self.id}" if self.id and not said else ""
        return " ".join(part for part in (self.class_id, score, number) if part)

    @property
    def class_id(self) -> str:
        """The likeliest class; empty without any."""
        return self._likeliest.class_id

    @property
    def score(self) -> float:
        """Of the likeliest class; 0 without any."""
        return self._likeliest.score

    @property
    def _likeliest(self) -> Hypothesis:
        return max(self.hypotheses, key=lambda one: one.score, default=NO_HYPOTHESIS)


@dataclass(frozen=True, eq=False)
class FoundArray(Message):
    """All that was found at one time; ``kind`` is the class of each."""

    kind: ClassVar[type[Found]]
    plotted: ClassVar[bool] = False
    renamed: ClassVar[bool] = True

    detections: tuple[Any, ...]
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        """The fields of the message, of ROS 1 and of ROS 2.

        Raises:
            ValueError: it is for ROS 1, and a class is not a number.
        """
        part = self.type_name.removesuffix("Array")
        found = [Fields(part, one.fields(self.header)) for one in self.detections]
        return {"header": header(self.header), "detections": found}

    @classmethod
    def read(cls: type[A], message: Any) -> A:
        """What was found; some detectors give no header but those of the detections."""
        name = "detections" if "detections" in field_names(message.__class__) else "apriltags"
        several = getattr(message, name)
        read = read_header(message.header)
        if read == Header() and len(several) and hasattr(several[0], "header"):
            read = read_header(several[0].header)
        return cls(tuple(map(cls.kind.read, several)), read)
