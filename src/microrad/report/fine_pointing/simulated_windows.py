"""Pointing errors of simulated runs in time windows: a table for people, and the same as data."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from microrad.link.pointing.code_words import LostWords
from microrad.link.pointing.coded_residual import CodedResidual
from microrad.loop.disturbance.windows import ErrorIndex
from microrad.loop.pointing_loop.simulated_windows import SimulatedErrors
from microrad.report.fine_pointing.windows import index_text
from microrad.report.quantities import micro, percent, power_text, quantity
from microrad.report.tables import Table
from microrad.report.view import Block, Points, View


def simulated_view(
    errors: Sequence[SimulatedErrors],
    lost: LostWords | None,
    runs: int,
    left_out: Sequence[ErrorIndex] = (),
    coded: CodedResidual | None = None,
) -> View:
    """The indices of runs beside those of linear theory, and the code words that they lose, with their intervals.

    Args:
        errors: One for each index.
        lost: What is lost; None where the mission has no code word.
        runs: How many runs there were.
        left_out: What does not fit into a run.
        coded: The coded link; None where the mission has no code with a known error rate.
    """
    rows = [
        (
            index_text(each.index),
            micro(each.linear_rad),
            micro(each.rms_rad),
            "unknown" if math.isinf(each.interval_rad) else f"± {micro(each.interval_rad)}",
        )
        for each in errors
    ]
    table = Table("Simulated, with hysteresis", ("index", "linear", "simulated", "99 % interval"), rows)
    about = (
        "Radial rms in µrad, both at the control samples: linear in theory, simulated on the mission's mirror. "
        f"Number of runs: {runs}; their spread gives the interval."
    )
    longer = f"Longer than a run behind its settling, and left out: {', '.join(map(index_text, left_out))}."
    blocks: list[Block] = [table, Points([about, *([longer] if left_out else [])])]
    blocks += [] if lost is None else _lost(lost)
    return View(table.title, blocks if coded is None else [*blocks, *_coded(coded)])


def _coded(c: CodedResidual) -> list[Block]:
    spread = "without an interleaver"
    if c.interleaving != "none":
        spread = f"with a {c.interleaving} interleaver over {quantity(c.span_s, 's')}"
    beyond = math.isinf(c.penalty_db)
    interval = "unknown" if math.isinf(c.ratio.high) else f"{power_text(c.ratio.low)} to {power_text(c.ratio.high)}"
    rows = [
        ("mean bit error ratio", power_text(c.ratio.value), interval),
        ("power that pointing costs", "beyond 20 dB" if beyond else quantity(c.penalty_db, "dB"), ""),
    ]
    about = (
        f"{c.code}, BPSK with soft decisions, {spread}, at {quantity(c.on_axis_db, 'dB')} more on the axis than the "
        f"code needs at constant power; the cost brings the mean back to {power_text(c.target)}. Power falls with each "
        "simulated error as that of a Gaussian beam, and stands still over a control sample."
    )
    return [Table("Coded link, simulated", ("of the coded link", "value", "99 % interval"), rows), Points([about])]


def _lost(lost: LostWords) -> list[Block]:
    word = quantity(lost.code_word_s, "s")
    rows = [
        (what, percent(share.value, 3), f"{percent(share.low, 3)} to {percent(share.high, 3)}")
        for what, share in ((f"code words of {word}", lost.lost), ("time", lost.time))
    ]
    about = (
        f"Of {lost.words} code words those whose mean power is less than the required margin asks for, and the share "
        "of the time with less than that. Where none or all are lost, the interval takes them as independent."
    )
    return [Table("Lost to pointing, simulated", ("share of", "lost", "99 % interval"), rows), Points([about])]


def simulated_data(
    errors: Sequence[SimulatedErrors],
    lost: LostWords | None,
    runs: int,
    left_out: Sequence[ErrorIndex] = (),
    coded: CodedResidual | None = None,
) -> dict[str, Any]:
    """The same as data: rms in rad, the interval as its half width, None where it is not known.

    Args:
        errors: One for each index.
        lost: What is lost; None where the mission has no code word.
        runs: How many runs there were.
        left_out: What does not fit into a run.
        coded: The coded link; None where the mission has no code with a known error rate.
    """
    found: dict[str, Any] = {
        "runs": runs,
        "indices": _indices(errors),
        "left_out": [index_text(each) for each in left_out],
    }
    found |= {} if lost is None else {"code_words": asdict(lost)}
    return found if coded is None else {**found, "coded": asdict(coded)}


def _indices(errors: Sequence[SimulatedErrors]) -> list[dict[str, Any]]:
    return [
        {
            "index": each.index.kind,
            "window_s": each.index.window_s,
            "spacing_s": each.index.spacing_s,
            "linear_rad": each.linear_rad,
            "simulated_rad": each.rms_rad,
            "interval_rad": None if math.isinf(each.interval_rad) else each.interval_rad,
            "simulated_by_axis_rad": each.axis_rms_rad.tolist(),
        }
        for each in errors
    ]
