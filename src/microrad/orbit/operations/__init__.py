"""The day: contacts and locks become data rates, volumes and latencies; terminals are shared; plans are written."""

from microrad.orbit.operations.base import OperationsError
from microrad.orbit.operations.latency import Latency, pool
from microrad.orbit.operations.plan import COLUMNS, PlannedSession, contact_plan, csv_text, spreadsheet_text
from microrad.orbit.operations.rates import RateTable, Service, Step, service
from microrad.orbit.operations.schedule import Opportunities, Rules, Sessions, schedule
from microrad.orbit.operations.store import Production, StoreHistory, deliver
from microrad.orbit.operations.totals import Totals, totals_by_relay, totals_by_satellite

__all__ = [
    "COLUMNS",
    "Latency",
    "OperationsError",
    "Opportunities",
    "PlannedSession",
    "Production",
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
    "totals_by_relay",
    "totals_by_satellite",
]
