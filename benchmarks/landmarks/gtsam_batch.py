"""The equations of a map, solved by GTSAM and by us: `python benchmarks/landmarks/gtsam_batch.py`.

Needs `pip install gtsam`. One step of the smoothing of a corridor of tags, six in each view: both
are given the same residuals and derivatives, so that only the elimination differs. Prints the time
of a step, and of the covariances of all tags; the memory that each took, and by how much the
results differ. Our step includes the sums of all terms, that of GTSAM not the making of its graph.
With `FOLDER`, TagSLAM's example_10, also the equations of that recording.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Callable, Sequence
from multiprocessing import get_context
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Any

import gtsam
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.normal import Factor, NormalEquations, Structure

SIZES = (300, 60), (1000, 200), (3000, 500)
SHARED, SEEN = 9, 6
Term = tuple[Floats, Sequence[tuple[Any, Floats]], Floats | None]


def corridor(views: int, tags: int) -> tuple[Structure, list[Term]]:
    """Equations of a walk along tags, with odometry between views; random derivatives."""
    random = np.random.default_rng(0)
    view = np.repeat(np.arange(views), SEEN)
    tag = (view * (tags - SEEN + 1)) // views + np.tile(np.arange(SEEN), views)
    steps = np.arange(views - 1)
    links = np.vstack([np.c_[view, tag + views], np.c_[steps, steps + 1]])

    def term(a: Any, b: Any, rows: int) -> Term:
        by = [random.standard_normal((len(a), rows, 6)) for _ in range(2)]
        shared = random.standard_normal((len(a), rows, SHARED))
        return random.standard_normal((len(a), rows)), ((a, by[0]), (b, by[1])), shared

    first = np.zeros(1, int), 100 * np.eye(6)[None]
    begin: Term = (np.zeros((1, 6)), (first,), None)
    prior: Term = (np.zeros((1, SHARED)), (), np.eye(SHARED)[None])
    terms = [term(view, tag + views, 8), term(steps, steps + 1, 6), begin, prior]
    return Structure(views, tags, SHARED, links), terms


def recording(folder: Path) -> tuple[Structure, list[Term]]:
    """Equations of TagSLAM's recording, where its map begins."""
    from tagslam import Recorded, joint_sightings, located

    from ros_visualise.estimation.mapping.minimising import chi2_of, linearised, robust
    from ros_visualise.estimation.mapping.problem import Problem
    from ros_visualise.estimation.mapping.starting import anchor_of, begin, poses
    from ros_visualise.estimation.mapping.terms import Terms
    from ros_visualise.estimation.mapping.unknowns import Unknowns

    recorded = Recorded(folder, 0.0)
    several, names, sightings = joint_sightings(recorded, located(recorded))
    problem = Problem(np.arange(len(several), dtype=np.int64), names, sightings)
    problem = Problem(problem.stamps_ns, names, sightings, anchor=anchor_of(problem))
    begun = begin(problem)
    problem = problem.restricted(begun.views, begun.tags)
    state = Unknowns(
        poses(begun.T_views[begun.views]), poses(begun.T_tags[begun.tags]), np.zeros(SHARED)
    )
    terms, kept = Terms(problem), []
    own_add = NormalEquations.add

    def add(self: NormalEquations, residuals: Floats, parts: Any, shared: Any = None) -> None:
        kept.append((residuals, parts, shared))
        own_add(self, residuals, parts, shared)

    NormalEquations.add = add  # type: ignore[method-assign]
    linearised(terms, state, robust(9 * float(np.median(chi2_of(terms, state)))))
    NormalEquations.add = own_add  # type: ignore[method-assign]
    return terms.structure, kept


def ours(structure: Structure, terms: list[Term]) -> tuple[float, float, Floats, Floats]:
    """Seconds for a step and for covariances, the step of the tags, and their covariances."""
    begin = time.perf_counter()
    normal = NormalEquations(structure)
    for residuals, parts, shared in terms:
        normal.add(residuals, parts, shared)
    factor = Factor(normal)
    step = factor.step()[1]
    stepped = time.perf_counter()
    covariances = factor.inverse().own[structure.views : structure.count]
    return stepped - begin, time.perf_counter() - stepped, step, covariances


def by_gtsam(structure: Structure, terms: list[Term]) -> tuple[float, float, Floats, Floats]:
    """The same by GTSAM: multifrontal Cholesky in the order of COLAMD."""
    graph, last = gtsam.GaussianFactorGraph(), structure.count
    for residuals, parts, shared in terms:
        model = gtsam.noiseModel.Unit.Create(residuals.shape[1])
        for n, residual in enumerate(residuals):
            blocks = [(int(at[n]), by[n]) for at, by in parts]
            blocks += [] if shared is None else [(last, shared[n])]
            graph.add(*(one for block in blocks for one in block), -residual, model)
    begin = time.perf_counter()
    ordering = gtsam.Ordering.ColamdGaussianFactorGraph(graph)
    found = graph.optimize(ordering)
    tags = range(structure.views, structure.count)
    step = np.array([found.at(key) for key in tags])
    stepped = time.perf_counter()
    tree = graph.eliminateMultifrontal(ordering)
    covariances = np.array([tree.marginalCovariance(key) for key in tags])
    return stepped - begin, time.perf_counter() - stepped, step, covariances


def _measured(way: Callable[..., Any], made: Callable[..., Any], of: Any, answers: Queue) -> None:
    structure, terms = made(*of)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = way(structure, terms)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    answers.put((*found, (most - before) / 1024, structure.views, structure.tags))


def compare(made: Callable[..., Any], *of: Any) -> None:
    """Print a row, each way in a process of its own."""
    results = []
    for way in (ours, by_gtsam):
        answers = get_context("fork").Queue()
        process = get_context("fork").Process(target=_measured, args=(way, made, of, answers))
        process.start()
        results.append(answers.get(timeout=300))
        process.join()
    own, other = results
    cells = [f"{one[0]:.2f} | {one[1]:.2f} | {one[4]:.0f}" for one in results]
    off = [float(np.abs(own[n] - other[n]).max() / np.abs(other[n]).max()) for n in (2, 3)]
    print(f"| {own[5]} x {own[6]} | {' | '.join(cells)} | {max(off):.0e} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?")
    folder = parser.parse_args().folder
    sys.path.insert(0, str(Path(__file__).parent))
    print(
        "| views x tags | ours: step, s | covariances, s | MiB | GTSAM: step, s | covariances, s |"
        " MiB | difference |\n|---|---|---|---|---|---|---|---|"
    )
    for size in SIZES:
        compare(corridor, *size)
    if folder:
        compare(recording, folder)
