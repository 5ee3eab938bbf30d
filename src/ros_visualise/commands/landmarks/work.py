"""Running a graph that finds landmarks, and printing and saving what it found."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.commands.landmarks import LandmarksOptions
from ros_visualise.commands.landmarks.graph import files_of, landmark_graph
from ros_visualise.commands.landmarks.mapping import LandmarkMapper, MappedLandmarks
from ros_visualise.commands.landmarks.mapping_report import report_lines, report_values
from ros_visualise.commands.landmarks.places import PlaceLog, save_places
from ros_visualise.commands.landmarks.sightings import DetectionLog, image_json, landmarks_json
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.core.paths import given_folder, set_folder
from ros_visualise.core.printing import (
    counted,
    escaped,
    in_columns,
    print_json,
    print_result,
    print_status,
)
from ros_visualise.core.signals import STOPPED, StopRequest, noticed
from ros_visualise.data import Header
from ros_visualise.estimation.camera_view import PLACE
from ros_visualise.estimation.localization import map_file
from ros_visualise.estimation.localization.messages import LandmarkMessages
from ros_visualise.estimation.visual.place_file import load_looks, places_path
from ros_visualise.graph import Graph
from ros_visualise.graph.landmarks import LOCALIZER, PLACES, has_frames
from ros_visualise.nodes.landmark_localizer import check_map_name
from ros_visualise.running.interruptible import in_a_second, in_time, interruptible
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.report import RunReport
from ros_visualise.sinks.files import TargetFile, check_new, write_file
from ros_visualise.sinks.geography import check_geography
from ros_visualise.sources.pictures import Pictures
from ros_visualise.sources.playback import Playback

_SPIN_S = 0.05
_UNPLACED = (
    "no positions in a fixed frame, because the pose of the camera is unknown; --json prints the"
    " poses of landmarks in the camera for each image, and --map OUT.yaml maps tags relative to"
    " each other"
)


def find_landmarks(options: LandmarksOptions) -> int:
    """Find landmarks until the source ends; the exit status is 1 if data was lost."""
    _check(options)
    graph = interruptible(lambda: landmark_graph(options))
    playback = Playback(
        rate=0.0, start_s=options.start or 0.0, duration_s=options.duration, frames=options.frames
    )
    runtime = interruptible(lambda: LocalRuntime(graph, playback))
    found = DetectionLog(graph)
    mapper = (
        None if options.map is None else LandmarkMapper(graph, options.survey, files_of(options))
    )
    places = None if options.geo is None else PlaceLog(graph)
    for listeners in (one.listeners for one in (found, mapper, places) if one is not None):
        for topic, listener in listeners.items():
            runtime.topic(topic).connect(listener)
    with noticed() as request:
        with in_time(request, lambda: runtime.steps):
            stopped = _run(runtime, request)
        mapped = in_a_second(request, lambda: mapper.finish(found.map)) if mapper else None
        stopped = stopped or request.asked
        if mapper:
            _save_map(runtime, mapped, found, options, stopped)
        report = runtime.report()
        _print(graph, found, mapped, report, options, places)
        if places is not None and options.geo is not None:
            try:
                said = save_places(options.geo, places, report, options.overwrite)
            except RosVisualiseError as error:
                if not stopped:
                    raise
                said = f"ros-visualise: {error}"
            print_status(said)
        for node in report.nodes.values():
            for note in node.unread:
                print_status(f"ros-visualise: {options.input}: {note}")
    return STOPPED if stopped else int(runtime.failed or report.is_incomplete)


def _check(options: LandmarksOptions) -> None:
    """Reject at once a map that could not be written at the end.

    Raises:
        UsageError: the map cannot be written there, or --survey or --places lacks a map.
    """
    if options.tracks and options.geo is None:
        raise UsageError("--tracks: requires --geo OUT")
    if options.geo is not None:
        check_geography(options.geo)
        check_new([options.geo], options.overwrite, options.input)
    if options.map is not None:
        check_map_name(options.map)
        check_new([options.map], options.overwrite, options.input)
        if options.places:
            TargetFile.check(places_path(options.map), options.overwrite)
        set_folder(given_folder(), options.overwrite)  # of what nodes save
    elif options.survey or options.places:
        what = f"--survey {options.survey}" if options.survey else "--places"
        raise UsageError(f"{what}: requires --map OUT.yaml")


def _run(runtime: LocalRuntime, request: StopRequest) -> bool:
    """Run to the end; True if it was asked for before."""
    try:
        runtime.start()
        while not runtime.wait(_SPIN_S):
            if request.asked:
                return True
        return False
    finally:
        runtime.stop()


def _save_map(
    runtime: LocalRuntime,
    mapped: MappedLandmarks | None,
    found: DetectionLog,
    options: LandmarksOptions,
    stopped: bool,
) -> None:
    """Write the map; that of a stopped run as far as it goes."""
    assert options.map is not None
    if mapped is not None and mapped.map.tracks:
        if options.places:
            mapped = _save_places(runtime, mapped, options.map)
        stamp_ns = found.map.header.stamp_ns if found.map else 0
        header = Header(stamp_ns, mapped.frame_id)
        found.map = LandmarkMessages().detections(mapped.landmarks, header)
        text = map_file.to_text(mapped.frame_id, mapped.landmarks, mapped.map.common)
        write_file(options.map, text.encode(), options.overwrite)
        return
    is_empty = found.map is None or not found.map.detections
    if is_empty and stopped:
        print_status(f"ros-visualise: {options.map}: not written: no landmarks in the map yet")
        return
    if is_empty:
        raise RosVisualiseError(
            f"{options.map}: not written: no landmarks in the map; give the tag size with --size"
            f" or --tags, and the camera's calibration"
        )
    assert found.map is not None
    runtime.act(LOCALIZER, "save_map")
    header = replace(found.map.header, frame_id=map_file.load(options.map).frame_id)
    found.map = replace(found.map, header=header)
    if stopped:
        print_status(f"ros-visualise: {options.map}: contains unsmoothed landmarks")
    if options.places:
        _say_no_places(options.map, "the map was not smoothed")


def _save_places(runtime: LocalRuntime, mapped: MappedLandmarks, path: Path) -> MappedLandmarks:
    """Write the places of a map; the map without those that the node has forgotten."""
    kept: set[str] = set()
    if mapped.has_places:
        runtime.act(PLACES, "save_places")
        file = places_path(path)
        kept = {f"{PLACE}{look.id}" for look in (load_looks(file) if file.exists() else [])}
    mapped = mapped.with_places(kept)
    if not mapped.has_places:
        _say_no_places(path, "no place was found, or none that the tags locate")
    return mapped


def _say_no_places(path: Path, why: str) -> None:
    print_status(f"ros-visualise: {places_path(path)}: not written: {why}")


def _print(
    graph: Graph,
    found: DetectionLog,
    mapped: MappedLandmarks | None,
    report: RunReport,
    options: LandmarksOptions,
    places: PlaceLog | None,
) -> None:
    paths = _paths(graph)
    images = [image_json(image, paths.get(image.stamp_ns)) for image in found.images]
    localizer = report.nodes.get(LOCALIZER)
    seen = dict(localizer.own["seen"]) if localizer else {}
    seen |= {one.name: one.seen for one in mapped.landmarks} if mapped else {}
    landmarks = landmarks_json(found, seen)
    if options.json:
        values: dict[str, Any] = {"images": images, "landmarks": landmarks}
        values |= {"places": [one.values for one in places.found()[0]]} if places else {}
        values |= {"smoothing": report_values(mapped.map, mapped.unused)} if mapped else {}
        print_json(values, allow_nan=False)
        return
    if paths and not mapped:
        rows = _of_pictures(images)
    else:
        heads = ("landmark", "seen", "position, metres", "+-", "frame")
        rows = [heads, *((*_named(one), *_placed(one)) for one in landmarks)]
    total = f"{counted(len(landmarks), 'landmark')} in {counted(len(images), 'image')}"
    print_result(
        [*_table(rows, total), *(report_lines(mapped.map, mapped.unused) if mapped else [])]
    )
    if not (paths or places or has_frames(graph)) and _are_unplaced(images, landmarks):
        print_status(f"ros-visualise: {options.input}: {_UNPLACED}")


def _are_unplaced(images: list[dict[str, Any]], landmarks: list[dict[str, Any]]) -> bool:
    """True if there are poses in the camera alone."""
    poses = [one["pose"] for image in images for one in image["detections"]]
    return any(poses) and not any(one["pose"] for one in landmarks)


def _paths(graph: Graph) -> dict[int, str]:
    """Timestamp -> file, for pictures."""
    assert graph.source is not None
    if graph.source.name != "pictures":
        return {}
    params: Any = graph.source.params
    pictures = Pictures(params.path, params.fps)
    return {pictures.stamp_ns(index): str(path) for index, path in enumerate(pictures.files)}


def _of_pictures(images: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Each landmark in each picture; for several pictures, after the picture's name."""
    rows: list[tuple[str, ...]] = [("picture", "landmark", "position, metres", "+-", "frame")]
    for image in images:
        name = escaped(os.path.basename(image["path"]))
        rows += [(name, escaped(one["name"]), *_placed(one)) for one in image["detections"]]
    return rows if len(images) > 1 else [row[1:] for row in rows]


def _named(one: dict[str, Any]) -> tuple[str, str]:
    return escaped(one["name"]), str(one["seen"])


def _placed(one: dict[str, Any]) -> tuple[str, str, str]:
    return *_place(one["pose"]), escaped(one["frame_id"])


def _table(rows: list[tuple[str, ...]], total: str) -> list[str]:
    """Lines in columns; the first row holds the heads."""
    if len(rows) == 1:
        return [f"no landmarks in {total.partition(' in ')[2]}"]
    return [*in_columns(rows), total]


def _place(pose: dict[str, Any] | None) -> tuple[str, str]:
    """A position, and the largest of its standard deviations, if known."""
    if pose is None:
        return "-", "-"
    variance = np.linalg.eigvalsh(np.reshape(pose["covariance"], (6, 6))[:3, :3])[-1]
    place = " ".join(f"{value:8.3f}" for value in pose["position"])
    return place, f"{np.sqrt(variance):.3f}" if variance > 0 else "-"
