"""Minima of a distance between the points of a grid."""

import numpy as np
from numpy.testing import assert_allclose

from microrad.loop.control import dips

GRID = np.array([1.0, 2.0, 3.5, 4.0, 6.0, 7.0])


def test_a_parabola_has_its_minimum_at_once():
    squared = np.array([2.0 * (GRID - 3.2) ** 2 + 0.3, 5.0 * (GRID - 4.4) ** 2 + 0.1])
    found = dips.on_grid(squared, GRID)
    assert found.row.tolist() == [0, 1]
    assert found.at.tolist() == [2, 3]
    assert_allclose(found.freq_hz, [3.2, 4.4], rtol=1e-12)
    assert_allclose(found.squared, [0.3, 0.1], rtol=1e-12)
    assert found.width_hz.tolist() == [0.5, 0.5]


def test_no_minimum_is_sought_where_one_grid_follows_the_other_or_at_its_ends():
    squared = np.concatenate([GRID, GRID])  # least where the second grid begins
    assert dips.on_grid(squared[None], np.concatenate([GRID, GRID])).at.size == 0
    assert dips.on_grid(-GRID[None], GRID).at.size == 0


def test_what_is_no_parabola_is_followed_to_its_end():
    """cosh(f - 3.2) - 0.7 has its least, 0.3, at 3.2."""

    def squared_at(freq_hz):
        return np.cosh(freq_hz - 3.2) - 0.7

    found = dips.on_grid(squared_at(GRID)[None], GRID)
    assert abs(found.squared[0] - 0.3) > 1e-3  # between the points of the grid alone
    assert_allclose(dips.followed(squared_at, found.freq_hz, found.width_hz), [0.3], atol=1e-9)


def test_nothing_is_asked_where_there_is_no_minimum():
    none = np.zeros(0)
    assert dips.followed(lambda freq_hz: 1 / 0, none, none).size == 0


def test_minima_of_several_rows_on_an_uneven_grid_are_those_of_their_parabolas():
    freq = np.array([0.0, 1.0, 1.5, 3.0, 3.2, 5.0, 4.0, 4.5, 6.0])  # a second grid behind the first
    rows = np.array([[1.4, 2.0, 7.0], [3.05, 0.5, 0.3], [4.6, 0.7, 9.0]])  # place, depth, curvature
    found = dips.on_grid(rows[:, 1:2] + rows[:, 2:] * (freq - rows[:, :1]) ** 2, freq)
    assert found.row.tolist() == [0, 1, 2] and found.at.tolist() == [2, 3, 7]
    assert_allclose(found.freq_hz, rows[:, 0], rtol=1e-12)
    assert_allclose(found.squared, rows[:, 1], rtol=1e-12)
    assert_allclose(found.width_hz, [0.5, 0.2, 0.5], rtol=1e-12)


def test_a_minimum_is_not_sought_farther_than_its_width_and_not_where_the_distance_bends_down():
    def bowl(at, bend):
        return lambda freq: 2.0 + np.array(bend)[:, None] * (freq - np.array(at)[:, None]) ** 2

    near, far, down = dips.followed(bowl([5.3, 9.0, 5.3], [4.0, 4.0, -4.0]), np.full(3, 5.0), np.array([1.0, 0.5, 1.0]))
    farther = 5.0 + 2 * 0.5 * 0.5  # half of the width each time
    assert_allclose([near, far, down], [2.0, 2.0 + 4.0 * (9.0 - farther) ** 2, 2.0 - 4.0 * 0.3**2], rtol=1e-9)
