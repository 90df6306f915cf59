"""One contact in time, in words, as rows of text and as plain data."""

from typing import Any

from microrad.report.data import fields
from microrad.report.day.words import times
from microrad.report.quantities import counted, duration, minus, percent, quantity, volume
from microrad.report.tables import Table
from microrad.study.contact_run import ContactRun, State


def contact_sentences(run: ContactRun, number: int, controller: str, rate_bit_s: float | None) -> list[str]:
    """How the contact went.

    Args:
        run: the contact as it was simulated.
        number: its place among those of the day, from 1.
        controller: name of the controller of its fine loop.
        rate_bit_s: its data rate, bit/s; None where that is stepped with range, which leaves the volume to the day.
    """
    c, spent = run.contact, run.seconds
    length = c.end_s - c.start_s
    if run.data_s == 0.0:
        return [f"Contact {number} of {duration(length)} never comes to data: {run.log[-1].cause}."]
    before = run.first_data_s - c.start_s
    them = "it" if len(run.windows) == 1 else "them"
    lost = f"lock is never lost in {them}"
    if run.losses:
        every = duration(1.0 / run.losses_per_s)
        lost = f"lock is lost {times(run.losses)} in {them}, once in {every}, which the rest of the time does not show"
    carried = ""
    if rate_bit_s is not None:
        carried = f": {volume(run.bits(rate_bit_s))} at {quantity(rate_bit_s, 'bit/s')}"
    return [
        f"Contact {number} ({duration(length)}) under {controller}: data begin {quantity(before, 's')} after the rise, "
        f"{quantity(spent[State.LOCK], 's')} of it to lock, and flow for {duration(spent[State.DATA])}, "
        f"{100 * run.data_share:.1f} % of the contact{carried}. The fine loop is simulated in "
        f"{counted(len(run.windows), 'window')}, {duration(run.sampled_s)} in all, with the point-ahead and the rate "
        f"of the line of sight of each; {lost}."
    ]


def windows_table(run: ContactRun, quantile: float) -> Table:
    """The windows that were simulated in full.

    Args:
        run: the contact as it was simulated.
        quantile: share of the time that the mission's error is judged at, of 1.
    """
    headings = (
        "since rise (min)",
        "range (km)",
        "point-ahead (µrad)",
        "rate (µrad/s)",
        "rms (µrad)",
        f"{100 * quantile:g} % (µrad)",
        "largest (µrad)",
        "lowest margin (dB)",
        "below 0 dB",
    )
    rows = [
        (
            f"{(w.start_s - run.contact.start_s) / 60.0:.2f}",
            f"{w.range_m / 1e3:.0f}",
            f"{w.point_ahead_rad * 1e6:.1f}",
            f"{w.rate_rad_s * 1e6:.0f}",
            f"{w.rms_rad * 1e6:.2f}",
            f"{w.quantile_rad * 1e6:.2f}",
            f"{w.largest_rad * 1e6:.2f}",
            minus(f"{w.lowest_margin_db:+.2f}"),
            percent(w.share_below),
        )
        for w in run.windows
    ]
    of = ["start_s", "range_m", "point_ahead_rad", "rate_rad_s", "rms_rad", "quantile_rad", "largest_rad"]
    of += ["lowest_margin_db", "share_below_0_db"]
    return Table("", headings, rows, (), names={k: f"contact.windows.{name}" for k, name in enumerate(of)})


def transitions_table(run: ContactRun) -> Table:
    """The transitions of the terminal, in seconds since the rise."""
    begin = run.contact.start_s
    rows = [(t.state, t.to, t.cause, minus(f"{t.time_s - begin:.3f} s")) for t in run.log]
    folded = "Every transition of that contact"
    return Table("", ("state", "to", "cause", "time"), rows, (0, 1, 2), folded=folded)


def contact_run_data(run: ContactRun) -> dict[str, Any]:
    """The run as plain data, in SI units with the unit in each key."""
    simulated = ("start_s", "seconds", "range_m", "point_ahead_rad", "rate_rad_s")
    found = ("rms_rad", "quantile_rad", "largest_rad", "lowest_margin_db")
    return {
        **fields(run.contact, "start_s", "end_s"),
        "seconds_in_state": run.seconds,
        "losses": run.losses,
        "log": [fields(t, "time_s", "state", "to", "cause") for t in run.log],
        "windows": [{**fields(w, *simulated, *found), "share_below_0_db": w.share_below} for w in run.windows],
    }
