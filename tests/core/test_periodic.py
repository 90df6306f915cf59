"""Whole periods of signals, band-limited: against the sines that they are made of."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from microrad.core.periodic import delayed, upsampled


def sines(samples, time):
    """Two signals of three lines each, below half the rate of 1 Hz; time in periods of the samples."""
    turns = 2 * np.pi * np.outer(time, [1, 3, 5]) / samples
    return np.column_stack([0.7 + np.sin(turns + 0.3) @ [1.0, 0.5, 2.0], np.cos(turns) @ [3.0, -1.0, 0.2] - 0.1])


@pytest.mark.parametrize("samples", [12, 13])
@pytest.mark.parametrize("factor", [1, 2, 3, 7])
def test_more_samples_of_several_signals_are_those_of_their_lines(samples, factor):
    fine = upsampled(sines(samples, np.arange(samples)), factor)
    assert_allclose(fine, sines(samples, np.arange(samples * factor) / factor), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("rate_hz", "delay_s"), [(1.0, 0.25), (8.0, -0.4), (0.5, 7.3), (622.08e6, 1e-9)])
@pytest.mark.parametrize("factor", [1, 4])
def test_a_delay_is_later_by_its_share_of_a_sample_at_any_rate(rate_hz, delay_s, factor):
    found = delayed(sines(13, np.arange(13)), rate_hz, delay_s, factor)
    assert_allclose(found, sines(13, np.arange(13 * factor) / factor - rate_hz * delay_s), rtol=0, atol=1e-12)
    assert found.flags.c_contiguous


@pytest.mark.parametrize("samples", [2, 4, 6])
@pytest.mark.parametrize("factor", [2, 3, 4])
def test_a_line_at_half_the_rate_keeps_its_samples_and_is_a_cosine_between(samples, factor):
    alternating = np.column_stack([np.cos(np.pi * np.arange(samples)), 3 + np.arange(samples) ** 2.0])
    fine = upsampled(alternating, factor)
    assert_allclose(fine[:, 0], np.cos(np.pi * np.arange(samples * factor) / factor), rtol=0, atol=1e-12)
    assert_allclose(fine[::factor], alternating, rtol=0, atol=1e-12)
    late = delayed(alternating, 1.0, 1.0, factor)
    assert_allclose(late[::factor], np.roll(alternating, 1, axis=0), rtol=0, atol=1e-12)


@pytest.mark.parametrize("delay_s", [0.5, -0.2, 1.75])
@pytest.mark.parametrize("samples", [2, 4, 10])
@pytest.mark.parametrize("factor", [2, 3])
def test_a_line_at_half_the_rate_is_late_by_any_share_of_a_sample(samples, factor, delay_s):
    alternating = np.cos(np.pi * np.arange(samples))[:, None]
    late = delayed(alternating, 1.0, delay_s, factor)[:, 0]
    assert_allclose(late, np.cos(np.pi * (np.arange(samples * factor) / factor - delay_s)), rtol=0, atol=1e-12)
