"""What a row of a campaign gives: outputs of the residual, of the links under it and of the day, each with its unit."""

from dataclasses import dataclass
from typing import Literal

Group = Literal["residual", "link", "day"]


@dataclass(frozen=True, slots=True)
class Output:
    """An output by name: its SI unit ("" for a plain number), the unit that it is written in, and what it means."""

    name: str
    unit: str
    typical: str
    meaning: str
    group: Group


_ALL = (
    Output("residual_rms", "rad", "urad", "radial rms of the pointing error over time and noise", "residual"),
    Output("residual_quantile", "rad", "urad", "radial error not exceeded for fine_pointing.quantile", "residual"),
    Output("residual_largest", "rad", "urad", "largest radial error", "residual"),
    Output("beyond_share", "", "", "share of the time beyond requirement.pointing_error", "residual"),
    Output("lost_share", "", "", "share of the optical readings without the spot", "residual"),
    Output("saturated_share", "", "", "control samples with a drive at its limit, over all samples", "residual"),
    Output("beyond_rate_share", "", "", "plant steps beyond the mirror's identified rate, over all steps", "residual"),
    Output("outside_share", "", "", "plant steps outside the mirror's identified drive range, over all", "residual"),
    Output("margin", "dB", "dB", "margin that the communication link keeps but for requirement.outage", "link"),
    Output("margin_under_fades", "dB", "dB", "margin that the series of communication.fading leaves", "link"),
    Output("outage", "", "", "share of the time with less than 0 dB", "link"),
    Output("short", "", "", "share of the time with less than requirement.margin", "link"),
    Output("data_rate", "bit/s", "Mbit/s", "data rate that keeps requirement.margin but for the outage", "link"),
    Output("beacon_margin", "dB", "dB", "margin of the beacon as budgeted", "link"),
    Output("answer_margin", "dB", "dB", "margin of the answer as budgeted", "link"),
    Output("volume", "bit", "GB", "what the relay could carry in the mission's span", "day"),
    Output("contact_time", "s", "min", "time in contact with the relay in that span", "day"),
    Output("optical_volume", "bit", "GB", "what the optical downlink could carry in that span, on average", "day"),
)

OUTPUTS: dict[str, Output] = {output.name: output for output in _ALL}
"""Every output by its name, in the order in which they are written."""

RADIUS = "radius"
"""The radial error over the time of all rows, whose quantile a precision may ask for; no output of a row."""

TAIL_OUTPUTS: dict[str, Output] = {
    output.name: output
    for output in (
        Output("tail_radius", "rad", "urad", "radial error at the end of the run, its noise shifted", "residual"),
        Output("tail_log_weight", "", "", "logarithm of the weight that takes the shift back", "residual"),
    )
}
"""What a row gives in a campaign with a table `tail`, in place of all others."""
