"""The line through the ellipsoid centres: the paper's form, the orthogonal and the weighted.

Where the three agree, where the paper's form fails, and what each is faithful to.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magcomp.errors import InputError
from magcomp.fit.line import (
    SpaceLine,
    line_through,
    orthogonal_line,
    paper_line,
    regress_with_errors,
    weighted_line,
)
from magcomp.model import Level

SEEDS = range(40)
POSITIONS = np.array([0.0, 25.0, 50.0, 75.0, 100.0])
POINT = np.array([12.0, -30.0, 45.0])
STEEP = np.array([0.4, -0.3, 0.87])


def unit(vector: np.ndarray) -> np.ndarray:
    return np.asarray(vector, float) / np.linalg.norm(vector)


def centres_on(direction: np.ndarray) -> np.ndarray:
    return POINT + np.multiply.outer(POSITIONS, unit(direction))


def noisy(direction: np.ndarray, seed: int, noise: float = 1.0) -> np.ndarray:
    return centres_on(direction) + np.random.default_rng(seed).normal(scale=noise, size=(5, 3))


def equal_errors(noise: float = 1.0) -> np.ndarray:
    return np.tile(noise**2 * np.eye(3), (5, 1, 1))


def angle_deg(one: SpaceLine | np.ndarray, other: SpaceLine | np.ndarray) -> float:
    """Angle between two lines, whichever way they point."""
    a, b = (line.direction if isinstance(line, SpaceLine) else unit(line) for line in (one, other))
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b))))


def quick(centres: np.ndarray) -> SpaceLine:
    """The paper's line near enough for statistics over many seeds."""
    return paper_line(centres, most=500)


def rotation(seed: int) -> np.ndarray:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


# --- all three -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "fit",
    [paper_line, orthogonal_line, lambda c: weighted_line(c, equal_errors())],
    ids=["paper", "orthogonal", "weighted"],
)
def test_centres_exactly_on_a_line_give_that_line(fit):
    line = fit(centres_on(STEEP))
    assert angle_deg(line, STEEP) < 1e-4
    assert line.distances(centres_on(STEEP)).max() < 1e-4


OWN_ERROR_DEG = float(np.degrees(1.0 / (POSITIONS.std() * np.sqrt(5))))
"""What 1 mGauss on five centres leaves of the direction, per axis: σ / (σ_t √5)."""


@pytest.mark.parametrize("seed", SEEDS)
def test_for_equal_errors_the_weighted_line_is_the_orthogonal_line(seed):
    centres = noisy(STEEP, seed)
    assert angle_deg(weighted_line(centres, equal_errors()), orthogonal_line(centres)) < 1e-5


@pytest.mark.parametrize("seed", range(10))
def test_for_equal_errors_and_a_steep_line_the_papers_agrees_where_z_is_counted_from_the_middle(
    seed,
):
    centres = noisy(STEEP, seed)
    centred = centres - centres.mean(axis=0)
    assert angle_deg(paper_line(centred), orthogonal_line(centred)) < 0.1 * OWN_ERROR_DEG


def test_counted_from_elsewhere_the_papers_line_departs_by_a_good_part_of_its_own_error():
    """Equation 16 lets the constant 1s move, so the intercept pulls at the slope."""
    departures = []
    for seed in range(10):
        centres = noisy(STEEP, seed)
        departures.append(angle_deg(quick(centres), orthogonal_line(centres)))
    assert np.median(departures) > 0.3 * OWN_ERROR_DEG
    assert np.median(departures) < 1.5 * OWN_ERROR_DEG


@pytest.mark.parametrize(
    "centres", [np.zeros((1, 3)), np.zeros((5, 2)), np.zeros(3)], ids=["one", "flat", "vector"]
)
def test_fewer_than_two_points_in_space_are_refused(centres):
    for fit in (paper_line, orthogonal_line):
        with pytest.raises(InputError, match="at least two centres"):
            fit(centres)


@given(st.integers(0, 1000))
def test_feet_and_distances_are_pythagoras(seed):
    rng = np.random.default_rng(seed)
    line, centres = SpaceLine(rng.normal(size=3), unit(rng.normal(size=3))), rng.normal(size=(6, 3))
    squares = line.positions(centres) ** 2 + line.distances(centres) ** 2
    assert np.allclose(squares, np.sum((centres - line.point) ** 2, axis=1))


# --- the paper's iteration, docs/method.md, Equations 14 to 16 ---------------------


@pytest.mark.parametrize("seed", range(1))
def test_the_papers_line_is_what_its_printed_equations_iterate_to(seed):
    centres = noisy(STEEP, seed)
    x, y, z = centres.T
    b = np.zeros((10, 4))
    for k in range(5):
        b[2 * k] = [z[k], 1, 0, 0]
        b[2 * k + 1] = [0, 0, z[k], 1]
    observed = np.ravel(np.column_stack([x, y]))
    moved = b.copy()
    for _ in range(20_000):
        xi = np.linalg.inv(moved.T @ moved) @ moved.T @ observed  # 15
        moved = (np.linalg.inv(np.eye(4) + np.outer(xi, xi)) @ (b.T + np.outer(xi, observed))).T
    line = paper_line(centres, threshold=1e-13)
    on_z = line.point + np.multiply.outer((z - line.point[2]) / line.direction[2], line.direction)
    assert np.allclose(on_z[:, 0], xi[0] * z + xi[1], atol=1e-6)
    assert np.allclose(on_z[:, 1], xi[2] * z + xi[3], atol=1e-6)


@pytest.mark.parametrize("seed", range(2))
def test_the_papers_iteration_goes_on_until_it_has_settled(seed):
    centres = noisy(STEEP, seed)
    once, longer = paper_line(centres), paper_line(centres, threshold=1e-13, most=200_000)
    assert angle_deg(once, longer) < 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_the_papers_line_is_a_fixed_point_a_stationary_value_of_its_own_criterion(seed):
    """Σ(L̂−L)² + Σ(B̂−B)² is least when every row's share is rᵢ² / (1 + |ξ|²)."""
    centres = noisy(STEEP, seed)
    line = paper_line(centres, threshold=1e-13)
    slope = line.direction[:2] / line.direction[2]
    at_zero = line.point[:2] - slope * line.point[2]
    xi = np.array([slope[0], at_zero[0], slope[1], at_zero[1]])

    def criterion(values: np.ndarray) -> float:
        left_x = centres[:, 0] - values[0] * centres[:, 2] - values[1]
        left_y = centres[:, 1] - values[2] * centres[:, 2] - values[3]
        return float((left_x @ left_x + left_y @ left_y) / (1 + values @ values))

    def total(values: np.ndarray) -> float:
        """The criterion as printed, with B̂ from equation 16 for these ξ."""
        b = np.zeros((10, 4))
        b[0::2, 0], b[0::2, 1] = centres[:, 2], 1
        b[1::2, 2], b[1::2, 3] = centres[:, 2], 1
        observed = centres[:, :2].reshape(-1)
        moved = np.linalg.solve(
            np.eye(4) + np.outer(values, values), b.T + np.outer(values, observed)
        ).T
        return float(np.sum((moved @ values - observed) ** 2) + np.sum((moved - b) ** 2))

    assert total(xi) == pytest.approx(criterion(xi), rel=1e-9)
    for axis, step in itertools.product(range(4), (1e-3, -1e-3)):
        assert total(xi) <= total(xi + step * np.eye(4)[axis])


def test_a_line_perpendicular_to_z_has_no_form_in_z_and_is_refused_in_one_sentence():
    with pytest.raises(InputError) as caught:
        paper_line(centres_on(np.array([1.0, 2.0, 0.0])))
    assert str(caught.value).startswith("The paper's line x = a·z + b needs centres at different z")
    assert "\n" not in str(caught.value)


def test_the_other_two_lines_have_no_such_axis():
    flat = np.array([1.0, 2.0, 0.0])
    for line in (
        orthogonal_line(centres_on(flat)),
        weighted_line(centres_on(flat), equal_errors()),
    ):
        assert angle_deg(line, flat) < 1e-4


def test_near_the_perpendicular_the_papers_error_grows_and_the_orthogonal_lines_does_not():
    slopes_deg = (60.0, 1.0, 0.3)
    paper, orthogonal = [], []
    for slope in np.radians(slopes_deg):
        direction = np.array([np.cos(slope), 0.0, np.sin(slope)])
        centres = [noisy(direction, seed) for seed in SEEDS]
        paper.append(np.median([angle_deg(quick(c), direction) for c in centres]))
        orthogonal.append(np.median([angle_deg(orthogonal_line(c), direction) for c in centres]))
    assert max(orthogonal) < 1.0
    assert paper[0] < 1.2 * orthogonal[0]
    assert paper[0] < paper[1] < paper[2]
    assert paper[2] > 3 * orthogonal[2]


# --- errors as they are ----------------------------------------------------------------


def uneven(seed: int) -> np.ndarray:
    """Covariances of centres of which some are poor in some direction, as turntables give."""
    rng = np.random.default_rng([seed, 7])
    turned = [rotation(int(s)) for s in rng.integers(0, 10**6, 5)]
    stds = np.exp(rng.uniform(np.log(0.2), np.log(6.0), (5, 3)))
    return np.stack([r @ np.diag(s**2) @ r.T for r, s in zip(turned, stds, strict=True)])


def drawn(direction: np.ndarray, covariances: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng([seed, 8])
    errors = [rng.multivariate_normal(np.zeros(3), c) for c in covariances]
    return centres_on(direction) + np.stack(errors)


def test_for_unequal_errors_the_weighted_line_beats_the_papers_and_the_orthogonal():
    left = {"paper": [], "orthogonal": [], "weighted": []}
    for seed in range(40):
        covariances = uneven(seed)
        centres = drawn(STEEP, covariances, seed)
        left["paper"].append(angle_deg(quick(centres), STEEP))
        left["orthogonal"].append(angle_deg(orthogonal_line(centres), STEEP))
        left["weighted"].append(angle_deg(weighted_line(centres, covariances), STEEP))
    median = {name: np.median(errors) for name, errors in left.items()}
    assert median["weighted"] < 0.6 * median["paper"]
    assert median["weighted"] < 0.75 * median["orthogonal"]


@pytest.mark.parametrize("seed", range(20))
def test_the_weighted_line_is_the_least_of_the_sum_it_names(seed):
    covariances = uneven(seed)
    centres = drawn(STEEP, covariances, seed)
    line = weighted_line(centres, covariances)

    def weighted_sum(point: np.ndarray, direction: np.ndarray) -> float:
        total = 0.0
        for centre, covariance in zip(centres, covariances, strict=True):
            precision = np.linalg.inv(covariance)
            t = direction @ precision @ (centre - point) / (direction @ precision @ direction)
            off = centre - point - t * direction
            total += off @ precision @ off
        return float(total)

    least = weighted_sum(line.point, line.direction)
    rng = np.random.default_rng(seed)
    for size in (1e-1, 1e-2, 1e-3):
        for _ in range(20):
            other = weighted_sum(
                line.point + size * rng.normal(size=3),
                unit(line.direction + size * 1e-2 * rng.normal(size=3)),
            )
            assert least <= other + 1e-9


# --- what rotating and scaling the world does -------------------------------------------


@given(st.integers(0, 500), st.floats(0.1, 10.0))
@settings(max_examples=40)
def test_orthogonal_and_weighted_lines_turn_and_grow_with_the_world(seed, scale):
    turn = rotation(seed)
    covariances = uneven(seed)
    centres = drawn(STEEP, covariances, seed)
    turned = scale * centres @ turn.T
    turned_covariances = scale**2 * turn @ covariances @ turn.T
    pairs = (
        (orthogonal_line(centres), orthogonal_line(turned)),
        (weighted_line(centres, covariances), weighted_line(turned, turned_covariances)),
    )
    for before, after in pairs:
        assert angle_deg(turn @ before.direction, after) < 1e-3
        assert after.distances((scale * turn @ before.point)[None])[0] < 1e-2 * scale


def test_the_papers_line_does_not_turn_with_the_world():
    """Another choice of axes gives another answer to the same question."""
    moved = []
    for seed in SEEDS:
        centres = noisy(STEEP, seed, noise=4.0)
        turn = rotation(seed)
        if abs((turn @ unit(STEEP))[2]) > 0.3:
            moved.append(angle_deg(turn @ quick(centres).direction, quick(centres @ turn.T)))
    assert len(moved) > 10
    assert np.median(moved) > 0.2


# --- position along the line against the control quantity -------------------------------


def level(u: float, centre: np.ndarray, u_std: float = 0.01, std: float = 0.5) -> Level:
    return Level(u=u, u_std=u_std, centre=centre, covariance=std**2 * np.eye(3), count=100)


def test_the_line_says_where_the_centre_is_at_any_control_quantity():
    slope = np.array([1.5, -2.0, 0.7])
    line = line_through(tuple(level(u, POINT + slope * u) for u in (0.0, 20.0, 45.0)))
    at_30 = line.point + (line.intercept + line.slope * 30.0) * line.direction
    assert np.allclose(at_30, POINT + 30.0 * slope, atol=1e-6)
    assert line.slope == pytest.approx(np.linalg.norm(slope))
    assert line.straightness == pytest.approx(1.0)
    assert line.rms < 1e-6
    assert line.degrees == 3


def test_the_direction_points_the_way_the_control_quantity_grows():
    for sign in (1.0, -1.0):
        slope = sign * np.array([1.5, -2.0, 0.7])
        line = line_through(tuple(level(u, POINT + slope * u) for u in (0.0, 20.0, 45.0)))
        assert line.slope > 0
        assert np.allclose(line.direction, unit(slope))


def test_centres_on_a_bow_are_not_called_straight():
    bow = [level(u, np.array([u, 0.05 * u**2, 0.0])) for u in (0.0, 15.0, 30.0, 45.0)]
    line = line_through(tuple(bow))
    assert line.straightness < 0.995
    assert line.chi2 > 10 * line.degrees


def test_for_errors_in_y_alone_the_regression_is_weighted_least_squares():
    rng = np.random.default_rng(4)
    x, sigma = np.linspace(0.0, 50.0, 9), rng.uniform(0.5, 3.0, 9)
    y = 3.0 + 2.0 * x + sigma * rng.normal(size=9)
    slope, intercept, slope_std = regress_with_errors(x, np.full(9, 1e-18), y, sigma**2)
    design = np.column_stack([np.ones(9), x]) / sigma[:, None]
    expected = np.linalg.lstsq(design, y / sigma, rcond=None)[0]
    assert [intercept, slope] == pytest.approx(expected)
    assert slope_std == pytest.approx(np.sqrt(np.linalg.inv(design.T @ design)[1, 1]))


def test_for_equal_errors_in_both_the_regression_is_demings():
    rng = np.random.default_rng(5)
    true = np.linspace(0.0, 50.0, 12)
    x, y = true + rng.normal(size=12), 1.0 + 1.7 * true + rng.normal(size=12)
    slope, intercept, _ = regress_with_errors(x, np.ones(12), y, np.ones(12))
    sxx, syy = np.var(x), np.var(y)
    sxy = np.mean((x - x.mean()) * (y - y.mean()))
    deming = (syy - sxx + np.sqrt((syy - sxx) ** 2 + 4 * sxy**2)) / (2 * sxy)
    assert slope == pytest.approx(deming)
    assert intercept == pytest.approx(y.mean() - deming * x.mean())


def test_pearsons_data_with_yorks_weights_give_yorks_answer():
    """The classic test of such regressions: slope −0.4805, intercept 5.4799 (York 1966)."""
    x = np.array([0.0, 0.9, 1.8, 2.6, 3.3, 4.4, 5.2, 6.1, 6.5, 7.4])
    y = np.array([5.9, 5.4, 4.4, 4.6, 3.5, 3.7, 2.8, 2.8, 2.4, 1.5])
    x_weight = np.array([1000, 1000, 500, 800, 200, 80, 60, 20, 1.8, 1.0])
    y_weight = np.array([1.0, 1.8, 4, 8, 20, 20, 70, 70, 100, 500])
    slope, intercept, slope_std = regress_with_errors(x, 1 / x_weight, y, 1 / y_weight)
    assert slope == pytest.approx(-0.480533, abs=1e-5)
    assert intercept == pytest.approx(5.479910, abs=1e-4)
    assert slope_std == pytest.approx(0.0580, abs=0.0015)


def test_the_standard_error_of_the_slope_is_what_repetition_shows():
    rng = np.random.default_rng(6)
    true = np.linspace(0.0, 50.0, 6)
    x_std, y_std = (
        np.array([0.2, 0.5, 1.0, 0.3, 0.8, 0.4]),
        np.array([2.0, 1.0, 0.5, 3.0, 1.0, 2.0]),
    )
    found = [
        regress_with_errors(
            true + x_std * rng.normal(size=6),
            x_std**2,
            4.0 + 2.2 * true + y_std * rng.normal(size=6),
            y_std**2,
        )
        for _ in range(400)
    ]
    slopes, _, stated = np.array(found).T
    assert np.mean(slopes) == pytest.approx(2.2, abs=4 * slopes.std() / np.sqrt(400))
    assert np.std(slopes) == pytest.approx(np.mean(stated), rel=0.15)
