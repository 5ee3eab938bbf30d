"""Damage to files and folders, the same for the same seed."""

import random
import shutil
import struct
from pathlib import Path

from fuzz.drops import drop

_DROPPED = 0.3  # of the mutants lack a record
_EDGE = 256  # bytes at either end of a file, where formats keep what matters most
_EXTREMES = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF)
_ODD_WORDS = (
    b"nan",
    b"inf",
    b"-1",
    b"1e308",
    b"99999999999999999999",
    b"",
    b"\x00",
    b"\x1b[2J",
    b"\xff\xfe",
    b"[[[[",
    b"&a [*a]",
    b"{a: {b: c}}",
)


def mutate(whole: Path, target: Path, rng: random.Random) -> bool:
    """A damaged copy of a file or folder; whether one whole record is all that it lacks."""
    lacks = rng.random() < _DROPPED
    if whole.is_file():
        if lacks and drop(whole, target, rng):
            return True
        target.write_bytes(damage(whole.read_bytes(), rng))
        return False
    shutil.copytree(whole, target)
    if lacks:
        files = [path for path in target.rglob("*") if path.is_file()]
        file = rng.choice(sorted(files))
        if drop(file, file, rng):
            return True
    for _ in range(rng.choice((1, 1, 2))):
        files = sorted(path for path in target.rglob("*") if path.is_file())
        if files:
            _damage_file(rng.choice(files), rng)
    return False


def damage(data: bytes, rng: random.Random) -> bytes:
    """Damaged bytes: some bits, a region, a number, a word, or an end that is missing."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(_WAYS)(data, rng)
    return data


def _damage_file(path: Path, rng: random.Random) -> None:
    way = rng.randrange(8)
    if way == 0:
        path.unlink()
    elif way == 1:
        path.write_bytes(b"")
    elif way == 2:
        path.rename(path.with_name(f"{path.stem}\x1b[2J\n{path.suffix}"))
    else:
        path.write_bytes(damage(path.read_bytes(), rng))


def _place(data: bytes, rng: random.Random) -> int:
    size = len(data)
    near = min(_EDGE, size)
    return rng.choice(
        (rng.randrange(size + 1), rng.randrange(near + 1), size - rng.randrange(near + 1))
    )


def _region(data: bytes, rng: random.Random) -> tuple[int, int]:
    start = _place(data, rng)
    return start, min(len(data), start + rng.choice((1, 4, 32, 512, 8192)))


def _flip(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 3, 20))):
        if changed:
            changed[min(_place(data, rng), len(data) - 1)] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _overwrite(data: bytes, rng: random.Random) -> bytes:
    start, end = _region(data, rng)
    new = rng.randbytes(end - start) if rng.random() < 0.5 else bytes(end - start)
    return data[:start] + new + data[end:]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: _place(data, rng)]


def _remove(data: bytes, rng: random.Random) -> bytes:
    start, end = _region(data, rng)
    return data[:start] + data[end:]


def _repeat(data: bytes, rng: random.Random) -> bytes:
    start, end = _region(data, rng)
    return data[:end] + data[start:end] * rng.choice((1, 2, 50)) + data[end:]


def _move(data: bytes, rng: random.Random) -> bytes:
    start, end = _region(data, rng)
    rest = data[:start] + data[end:]
    place = _place(rest, rng)
    return rest[:place] + data[start:end] + rest[place:]


def _set_number(data: bytes, rng: random.Random) -> bytes:
    size, code = rng.choice(((1, "B"), (2, "H"), (4, "I"), (8, "Q")))
    value = rng.choice((*_EXTREMES, len(data), rng.getrandbits(63))) % 256**size
    start = _place(data, rng)
    return data[:start] + struct.pack(f"<{code}", value) + data[start + size :]


def _set_word(data: bytes, rng: random.Random) -> bytes:
    """Another word in place of one between spaces, as texts have them."""
    start = _place(data, rng)
    end = start
    while end < len(data) and not data[end : end + 1].isspace():
        end += 1
    return data[:start] + rng.choice(_ODD_WORDS) + data[end:]


_WAYS = (_flip, _overwrite, _cut, _remove, _repeat, _move, _set_number, _set_word)
