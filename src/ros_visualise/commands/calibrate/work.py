"""Printing a board, collecting views of it, and calibrating a camera by them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import TypeVar

from tqdm import tqdm

from ros_visualise.commands.calibrate import CalibrateOptions
from ros_visualise.commands.calibrate.report import draw, summary, to_json
from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.printing import counted, print_json, print_result, print_status
from ros_visualise.core.rate import WallClock
from ros_visualise.core.signals import STOPPED, StopRequest, noticed
from ros_visualise.landmarks.calibration.boards import Board, BoardKind, board_of
from ros_visualise.landmarks.calibration.calibrating import better_lens, calibrate
from ros_visualise.landmarks.calibration.collecting import ViewCollector
from ros_visualise.landmarks.calibration.lenses import Lens
from ros_visualise.landmarks.calibration.sheet import SHEET_FORMATS, lay_out
from ros_visualise.plotting.figure import FIGURE_FORMATS
from ros_visualise.sinks.files import check_new
from ros_visualise.sinks.names import check_suffix
from ros_visualise.sinks.trajectory import save
from ros_visualise.sources import open_source
from ros_visualise.sources.calibration import to_yaml
from ros_visualise.sources.camera import LiveCamera, is_live
from ros_visualise.sources.pictures import Pictures, is_pictures, read_picture
from ros_visualise.sources.recordings.images import image_topic, recorded_images

T = TypeVar("T")

_MOST_LOOKED_AT = 400  # images of a video or recording
_ENOUGH_VIEWS = 25  # of a camera, where they cover all


def calibrate_camera(options: CalibrateOptions) -> int:
    """Print the board if asked to, and calibrate if images are given."""
    board = board_of(
        BoardKind(options.pattern), options.size, options.square, options.share, options.dictionary
    )
    _check(options)
    if options.board is not None:
        sheet = lay_out(board, options.page, options.square)
        save({options.board: SHEET_FORMATS[options.board.suffix.lower()](sheet)}, options.overwrite)
        print_status(f"{options.board}: {sheet.caption}; print it at 100%")
    return _calibrate(options, board) if options.input else 0


def _check(options: CalibrateOptions) -> None:
    """Reject what cannot be done, before anything is read."""
    if not (options.input or options.board):
        raise UsageError("nothing to do: give pictures, a video or a camera, or --board FILE.pdf")
    check_suffix("--board", options.board, SHEET_FORMATS)
    check_suffix("--plot", options.plot, FIGURE_FORMATS)
    files = (options.board, options.output, options.plot)
    check_new(files, options.overwrite, *options.input)


def _calibrate(options: CalibrateOptions, board: Board) -> int:
    """Collect views, calibrate, write and report; the exit status."""
    collector = ViewCollector(board)
    with noticed() as request:
        losses = [
            loss for one in options.input for loss in _collect(one, options, collector, request)
        ]
    if request.asked and not any(map(is_live, options.input)):
        return STOPPED
    try:
        found = calibrate(collector.checked_views, Lens(options.model))
    except UsageError as error:
        raise UsageError(f"{options.input[0]}: {error}") from None
    better = better_lens(found)
    files: dict[Path, bytes] = {}
    if options.output is not None:
        text = to_yaml(found.info, options.name, found.fit.covariance)
        files[options.output] = text.encode()
    if options.plot is not None:
        files[options.plot] = FIGURE_FORMATS[options.plot.suffix.lower()](
            draw(found, collector.coverage)
        )
    save(files, options.overwrite)
    if options.json:
        print_json(to_json(found, collector, better))
    else:
        print_result(summary(found, collector, better))
    for loss in losses:
        print_status(f"ros-visualise: {loss}")
    return 1 if losses else 0


def _collect(
    source: str, options: CalibrateOptions, collector: ViewCollector, request: StopRequest
) -> list[str]:
    """Collect views from all images of a source, until asked to stop; notes on losses."""
    if is_live(source):
        _follow(source, options, collector, request)
        return []
    if is_pictures(source):
        return _look_at_pictures(Pictures(source, 1.0).files, collector, request)
    with closing(open_source(source)) as recording:
        images = recorded_images(recording, image_topic(recording, options.topic), _MOST_LOOKED_AT)
        for stamp_ns, image in _bar(images):
            name = f"{(stamp_ns - recording.start_ns) / 1e9:.2f} s"
            collector.add(image, name, thorough=False)
            if request.asked:
                break
        return [f"{source}: {note}" for note in recording.loss.notes]


def _look_at_pictures(
    paths: Sequence[Path], collector: ViewCollector, request: StopRequest
) -> list[str]:
    lost = []
    for path in _bar(paths):
        try:
            collector.add(read_picture(path), path.name)
        except OpenError as error:
            if len(paths) == 1:
                raise
            lost.append(str(error))
        if request.asked:
            break
    return lost


def _bar(images: Iterable[T]) -> Iterable[T]:
    bar: Iterable[T] = tqdm(images, unit=" images", disable=None, leave=False)
    return bar


def _follow(
    source: str, options: CalibrateOptions, collector: ViewCollector, request: StopRequest
) -> None:
    """Collect views from a camera until they cover the image, or time is over; print advice."""
    clock = WallClock()
    start_ns = clock.monotonic_ns()
    advice = ""
    print_status(f"{source}: show the board to the camera; Ctrl-C stops and calibrates")
    with closing(LiveCamera(source)) as camera:
        for newest in camera.images():
            gone_s = (clock.monotonic_ns() - start_ns) / 1e9
            if request.asked or (options.duration is not None and gone_s > options.duration):
                return
            if newest is None:
                continue
            before = len(collector.views)
            collector.add(newest[1], f"{gone_s:.2f} s", thorough=False)
            coverage = collector.coverage
            if len(collector.views) > before and coverage.advice != advice:
                advice = coverage.advice
                print_status(f"{counted(len(collector.views), 'view')}; {advice or 'show more'}")
            if len(collector.views) >= _ENOUGH_VIEWS and not coverage.advice:
                return
