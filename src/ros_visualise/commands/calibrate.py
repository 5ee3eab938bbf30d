"""``calibrate``: a camera, by pictures of a board; and the board itself, for printing."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import TypeVar

from tqdm import tqdm

from ros_visualise.commands.calibration_report import draw, summary, to_json
from ros_visualise.commands.wording import counted
from ros_visualise.errors import OpenError, UsageError
from ros_visualise.landmarks.calibration.boards import Board, Kind, board_of
from ros_visualise.landmarks.calibration.calibrating import better_lens, calibrate
from ros_visualise.landmarks.calibration.collecting import Collector
from ros_visualise.landmarks.calibration.lenses import Lens
from ros_visualise.landmarks.calibration.sheet import SHEET_FORMATS, lay_out
from ros_visualise.printing import answer, say
from ros_visualise.rate import WallClock
from ros_visualise.signals import STOPPED, Wish, noticed
from ros_visualise.sinks.figure import FIGURE_FORMATS
from ros_visualise.sinks.files import TargetFile
from ros_visualise.sinks.names import check_targets
from ros_visualise.sinks.trajectory import save
from ros_visualise.sources import open_source
from ros_visualise.sources.calibration_store import to_yaml
from ros_visualise.sources.camera import Camera
from ros_visualise.sources.live import is_live
from ros_visualise.sources.opening import NoRecording
from ros_visualise.sources.pictures import Pictures, is_pictures, no_pictures, read_picture
from ros_visualise.sources.recordings.images import image_topic, recorded_images

T = TypeVar("T")

_MOST_LOOKED_AT = 400  # images of a video or recording
_ENOUGH_VIEWS = 25  # of a camera, where they cover all


def run(args: Namespace) -> int:
    """Print the board if that is asked for, and calibrate if there are images."""
    board = board_of(Kind(args.pattern), args.size, args.square, args.share, args.dictionary)
    _check(args)
    if args.board is not None:
        sheet = lay_out(board, args.page, args.square)
        save({args.board: SHEET_FORMATS[args.board.suffix.lower()](sheet)}, args.overwrite)
        say(f"{args.board}: {sheet.caption}; print it at 100%")
    return _calibrate(args, board) if args.input else 0


def _check(args: Namespace) -> None:
    """Refuse what cannot be done, before anything is read."""
    if not (args.input or args.board):
        raise UsageError("nothing to do: give pictures, a video or a camera, or --board FILE.pdf")
    targets = [one for one in (args.board, args.output, args.plot) if one is not None]
    kinds = (("--board", args.board, [*SHEET_FORMATS]), ("--plot", args.plot, [*FIGURE_FORMATS]))
    for option, target, formats in kinds:
        if target is not None and target.suffix.lower() not in formats:
            raise UsageError(f"{option} {target}: give a name that ends in {' or '.join(formats)}")
    for source in args.input or [None]:
        check_targets(targets, source)
    for target in targets:
        TargetFile.check(target, args.overwrite)


def _calibrate(args: Namespace, board: Board) -> int:
    """Collect views, calibrate, write and report; the exit status."""
    collector = Collector(board)
    with noticed() as wish:
        losses = [loss for one in args.input for loss in _collect(one, args, collector, wish)]
    if wish.asked and not any(map(is_live, args.input)):
        return STOPPED
    if not collector.found:
        raise OpenError(
            f"{args.input[0]}: no board in {counted(collector.seen, 'image')}:"
            f" no {collector.finder.tried}; check --pattern and --size"
        )
    found = calibrate(collector.views, Lens(args.model))
    better = better_lens(found)
    files: dict[Path, bytes] = {}
    if args.output is not None:
        files[args.output] = to_yaml(found.info, args.name).encode()
    if args.plot is not None:
        files[args.plot] = FIGURE_FORMATS[args.plot.suffix.lower()](draw(found, collector.coverage))
    save(files, args.overwrite)
    if args.json:
        answer([json.dumps(to_json(found, collector, better))])
    else:
        answer(summary(found, collector, better))
    for loss in losses:
        say(f"ros-visualise: {loss}")
    return 1 if losses else 0


def _collect(source: str, args: Namespace, collector: Collector, wish: Wish) -> list[str]:
    """Look at all images of a source, until somebody asks for the end; what was lost."""
    if is_live(source):
        _follow(source, args, collector, wish)
        return []
    if is_pictures(source):
        return _look_at_pictures(Pictures(source, 1.0).files, collector, wish)
    try:
        opened = open_source(source)
    except NoRecording:
        raise no_pictures(source) from None
    with closing(opened) as recording:
        images = recorded_images(recording, image_topic(recording, args.topic), _MOST_LOOKED_AT)
        for stamp_ns, image in _bar(images):
            name = f"{(stamp_ns - recording.start_ns) / 1e9:.2f} s"
            collector.add(image, name, thorough=False)
            if wish.asked:
                break
        return [f"{source}: {note}" for note in recording.loss.notes]


def _look_at_pictures(paths: Sequence[Path], collector: Collector, wish: Wish) -> list[str]:
    lost = []
    for path in _bar(paths):
        try:
            collector.add(read_picture(path), path.name)
        except OpenError as error:
            if len(paths) == 1:
                raise
            lost.append(str(error))
        if wish.asked:
            break
    return lost


def _bar(images: Iterable[T]) -> Iterable[T]:
    bar: Iterable[T] = tqdm(images, unit=" images", disable=None, leave=False)
    return bar


def _follow(source: str, args: Namespace, collector: Collector, wish: Wish) -> None:
    """A camera's images, until enough of them cover all, or time is over; says what to do next."""
    clock = WallClock()
    start_ns = clock.monotonic_ns()
    advice = ""
    say(f"{source}: show the board to the camera; Ctrl-C ends it and calibrates")
    with closing(Camera(source)) as camera:
        for newest in camera.images():
            gone_s = (clock.monotonic_ns() - start_ns) / 1e9
            if wish.asked or (args.duration is not None and gone_s > args.duration):
                return
            if newest is None:
                continue
            before = len(collector.views)
            collector.add(newest[1], f"{gone_s:.2f} s", thorough=False)
            coverage = collector.coverage
            if len(collector.views) > before and coverage.advice != advice:
                advice = coverage.advice
                say(f"{counted(len(collector.views), 'view')}; {advice or 'a few more'}")
            if len(collector.views) >= _ENOUGH_VIEWS and not coverage.advice:
                return
