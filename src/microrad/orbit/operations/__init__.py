"""From contacts to data: rates, the store and its latencies, the schedule of shared terminals, contact plans."""

from microrad.orbit.base import OperationsError
from microrad.orbit.operations.plan import COLUMNS, PlannedSession, contact_plan, csv_text, spreadsheet_text
from microrad.orbit.operations.rates import RateTable, Service, Step, service
from microrad.orbit.operations.schedule import (
    Opportunities,
    Rules,
    Sessions,
    Totals,
    schedule,
    totals,
)
from microrad.orbit.operations.store import Latency, StoreHistory, deliver, pool

__all__ = [
    "COLUMNS",
    "Latency",
    "OperationsError",
    "Opportunities",
    "PlannedSession",
    "RateTable",
    "Rules",
    "Service",
    "Sessions",
    "Step",
    "StoreHistory",
    "Totals",
    "contact_plan",
    "csv_text",
    "deliver",
    "pool",
    "schedule",
    "service",
    "spreadsheet_text",
    "totals",
]
