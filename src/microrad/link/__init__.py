"""Link budgets: of the beacon, its answer and the communication link, and what follows from them."""

from microrad.link.budget.arrival import arrival_of
from microrad.link.budget.assembly import DataLink, LinkError, Shared, assembled, jitter_of, of, required_dbm
from microrad.link.budget.lines import DEEPEST_DB, LinkBudget, beam_budget, communication_budget, tracking_light_w
from microrad.link.budget.maps import (
    IdealReceiver,
    SensitivityReading,
    convention_maps,
    farther_db,
    ideal_receivers,
    implied_sensitivity,
    largest_data_rate,
    largest_pointing_error,
    margin_map,
    margin_of_error,
    rate_at_loss,
    received_on_axis_dbm,
)
from microrad.link.variation import LINK_TABLES, Interval, Swing, Tornado, beam_passes, swings

__all__ = [
    "DEEPEST_DB",
    "LINK_TABLES",
    "DataLink",
    "IdealReceiver",
    "Interval",
    "LinkBudget",
    "LinkError",
    "SensitivityReading",
    "Shared",
    "Swing",
    "Tornado",
    "arrival_of",
    "assembled",
    "beam_budget",
    "beam_passes",
    "communication_budget",
    "convention_maps",
    "farther_db",
    "ideal_receivers",
    "implied_sensitivity",
    "jitter_of",
    "largest_data_rate",
    "largest_pointing_error",
    "margin_map",
    "margin_of_error",
    "of",
    "rate_at_loss",
    "received_on_axis_dbm",
    "required_dbm",
    "swings",
    "tracking_light_w",
]
