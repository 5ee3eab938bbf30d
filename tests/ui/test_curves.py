"""What is drawn of many samples, held against the samples themselves."""

import numpy as np
import pytest

from ros_visualise.ui.live.curves import SampleStore, StoreFull
from ros_visualise.ui.live.derived import BadExpression, Expression, Sampled

RNG = np.random.default_rng(5)
COLUMNS = 300


def noise(count):
    """A walk with peaks and a gap."""
    values = RNG.normal(size=count).cumsum()
    values[RNG.integers(0, count, 20)] += RNG.normal(size=20) * 1000
    values[count // 3 : count // 3 + count // 50] = np.nan
    return values


def store_of(times_s, values, piece=977, **settings):
    """A store that got its samples in pieces."""
    store = SampleStore(["x"], **settings)
    for start in range(0, len(times_s), piece):
        store.add(times_s[start : start + piece], values[start : start + piece, None])
    return store


def columns_of(times_s, start_s, end_s):
    """The number of the column of each time."""
    edges_s = np.linspace(start_s, end_s, COLUMNS + 1)
    return np.searchsorted(edges_s[1:-1], times_s, "right")


def assert_is_drawn(store, times_s, values, start_s, end_s):
    """Each column has the extremes of its samples, a gap if they have one, and no other values."""
    seen_s, seen = store.between("x", start_s, end_s, COLUMNS)
    assert (np.diff(seen_s) >= 0).all()
    assert len(seen) <= 3 * COLUMNS + 2
    there = dict(zip(times_s.tolist(), values.tolist(), strict=True))
    assert all(
        there[t] == v or np.isnan([there[t], v]).all() for t, v in zip(seen_s, seen, strict=True)
    )
    is_inside = (times_s >= start_s) & (times_s <= end_s)
    times_s, values = times_s[is_inside], values[is_inside]
    is_inside = (seen_s >= start_s) & (seen_s <= end_s)
    seen_s, seen = seen_s[is_inside], seen[is_inside]
    ends_s = times_s[[0, -1]]
    owners, seen_owners = (columns_of(all_s, *ends_s) for all_s in (times_s, seen_s))
    for column in range(COLUMNS):
        own, drawn = values[owners == column], seen[seen_owners == column]
        assert len(own) == 0 or len(drawn) > 0
        assert np.isnan(own).any() == np.isnan(drawn).any() or len(own) <= 2
        if np.isfinite(own).any():
            assert np.nanmin(own) == np.nanmin(drawn)
            assert np.nanmax(own) == np.nanmax(drawn)


@pytest.mark.parametrize("count", [2 * COLUMNS + 1, 5000, 64 * 500, 100_003])
@pytest.mark.parametrize("part", [(0, 1), (0.1, 0.9), (0.3, 0.36), (0.5, 0.501)])
def test_each_column_has_the_extremes_of_its_samples(count, part):
    times_s = np.sort(RNG.uniform(0, 1000, count))
    values = noise(count)
    start_s, end_s = (1000 * end for end in part)
    if ((times_s >= start_s) & (times_s <= end_s)).sum() > 2 * COLUMNS:
        assert_is_drawn(store_of(times_s, values), times_s, values, start_s, end_s)


def test_few_samples_come_as_they_are_with_one_on_either_side():
    times_s = np.arange(10_000) / 10
    values = noise(10_000)
    seen_s, seen = store_of(times_s, values).between("x", 500, 510, COLUMNS)
    assert seen_s.tolist() == times_s[4999:5102].tolist()
    assert np.array_equal(seen, values[4999:5102], equal_nan=True)


def test_uneven_times_leave_columns_empty():
    times_s = np.concatenate([np.linspace(0, 1, 50_000), np.linspace(900, 1000, 2000)])
    values = noise(52_000)
    store = store_of(times_s, values)
    assert_is_drawn(store, times_s, values, 0, 1000)
    seen_s, _ = store.between("x", 0, 1e9, COLUMNS)
    assert_is_drawn(store, times_s, values, -5, 1e9)
    assert seen_s[0] == 0
    assert seen_s[-1] == 1000


def test_late_samples_give_what_sorted_ones_give():
    times_s = RNG.permutation(20_000) / 7
    values = noise(20_000)
    order = np.argsort(times_s)
    store = store_of(times_s, values)
    for path_s, path in store.whole("x"), store_of(times_s[order], values[order]).whole("x"):
        assert np.array_equal(path_s, times_s[order])
        assert np.array_equal(path, values[order], equal_nan=True)
    assert_is_drawn(store, times_s[order], values[order], 0, 3000)


def test_stamps_that_jump_back_remove_the_later_part():
    times_s, values = np.arange(50_000.0), noise(50_000)
    store = store_of(times_s, values)
    store.cut(20_000)
    assert len(store) == 20_000
    store.add(times_s[20_000:30_000], values[30_000:40_000, None])
    kept = np.concatenate([values[:20_000], values[30_000:40_000]])
    assert_is_drawn(store, times_s[:30_000], kept, 0, 1e9)
    store.cut(-1)
    assert len(store.between("x", 0, 1e9, COLUMNS)[0]) == 0


def test_infinities_are_extremes_and_only_nan_is_a_gap():
    values = np.zeros(10_000)
    values[[50, 51, 5000]] = np.inf, -np.inf, np.nan
    _, seen = store_of(np.arange(10_000.0), values).between("x", 0, 1e9, COLUMNS)
    assert {np.inf, -np.inf} <= set(seen.tolist())
    assert np.isnan(seen).sum() == 1
    assert len(SampleStore(["x"]).between("x", 0, 1, COLUMNS)[0]) == 0
    nothing = store_of(np.arange(10_000.0), np.full(10_000, np.nan))
    assert np.isnan(nothing.between("x", 0, 1e9, COLUMNS)[1]).all()


def test_memory_is_bounded():
    times_s, values = np.arange(300_000.0), noise(300_000)
    live = store_of(times_s, values, max_bytes=1 << 20)
    assert live.nbytes < 3 << 20
    last_s, last = live.whole("x")
    assert 20_000 < len(last) < 62_000
    assert np.array_equal(last, values[-len(last) :], equal_nan=True)
    assert_is_drawn(live, last_s, last, 0, 1e9)
    with pytest.raises(StoreFull):
        store_of(times_s, values, share=0.0, max_bytes=1 << 20)


def compute(text, **curves):
    """The values of an expression over curves of these names."""
    expression = Expression(text)
    assert set(expression.names) <= curves.keys()
    return expression.compute(lambda name: curves[name])


TIMES_S = np.sort(RNG.uniform(0, 20, 2000))
SINE = Sampled(TIMES_S, np.sin(TIMES_S))


def test_derivative_and_integral_are_inverse():
    rate = compute('derivative("x")', x=SINE)
    assert np.isnan(rate.values[0])
    middle_s = (TIMES_S[1:] + TIMES_S[:-1]) / 2
    assert np.allclose(rate.values[1:], np.cos(middle_s), atol=1e-3)
    area = compute('integral("x")', x=SINE)
    assert np.allclose(area.values, np.cos(TIMES_S[0]) - np.cos(TIMES_S), atol=1e-3)


def test_means_are_those_of_each_window():
    values = noise(2000)
    found = compute('mean("x", 0.5)', x=Sampled(TIMES_S, values)).values
    for at in (0, 3, 700, 1500, 1999):
        inside = values[np.abs(TIMES_S - TIMES_S[at]) <= 0.25]
        expected = np.nanmean(inside) if np.isfinite(inside).any() else np.nan
        assert found[at] == pytest.approx(expected, nan_ok=True)


def test_angles_of_quaternions_and_their_turns():
    angle = np.linspace(-9, 9, 500)
    times_s = np.arange(500.0)
    half = {"x": 0 * angle, "y": 0 * angle, "z": np.sin(angle / 2), "w": np.cos(angle / 2)}
    parts = {f"q.{name}": Sampled(times_s, values) for name, values in half.items()}
    found = compute('unwrap(yaw("q"))', **parts).values
    assert np.allclose(found - found[0], angle - angle[0])
    rolled = {"q.x": parts["q.z"], "q.z": parts["q.x"]}
    turned = compute('unwrap(roll("q"))', **{**parts, **rolled}).values
    assert np.allclose(turned - turned[0], angle - angle[0])


def test_curves_of_several_topics_are_aligned_by_their_times():
    other_s = np.linspace(5, 15, 101)
    other = Sampled(other_s, 2 * other_s)
    found = compute('"a" * 0 + "b"', a=SINE, b=other)
    assert np.array_equal(found.times_s, TIMES_S)
    is_inside = (TIMES_S >= 5) & (TIMES_S <= 15)
    assert np.allclose(found.values[is_inside], 2 * TIMES_S[is_inside])
    assert np.isnan(found.values[~is_inside]).all()


def test_operators_are_those_of_numbers():
    found = compute('-"x" / 2 + 3 ** 2 - max("x", 0.5) % 7 + hypot(3, 4)', x=SINE)
    x = SINE.values
    assert np.allclose(found.values, -x / 2 + 9 - np.maximum(x, 0.5) + 5)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1",
        "x",
        '"x" +',
        '"x".__class__',
        '"x"[0]',
        'open("x")',
        '__import__("os").system("true")',
        'eval("x")',
        '(lambda: "x")()',
        '["x" for _ in (1,)]',
        'f"{1}"',
        'b"x"',
        'derivative("x", 2)',
        'derivative(x="x")',
        'derivative(*"x")',
        'yaw("x" + "y")',
        '"x" if 1 else "y"',
        '"x" @ "x"',
        '"x" << 9',
        "-" * 400 + '"x"',
        "(" * 200 + '"x"' + ")" * 200 + "+" * 99,
        '"x" * ' + "9" * 400,
        "9" * 4000,
    ],
)
def test_all_else_is_rejected(text):
    with pytest.raises(BadExpression):
        Expression(text)


@pytest.mark.parametrize("text", ['mean("x", "x")', 'mean("x", -1)', 'mean(3, 1) + "x"'])
def test_wrong_arguments_are_reported(text):
    with pytest.raises(BadExpression):
        compute(text, x=SINE)
