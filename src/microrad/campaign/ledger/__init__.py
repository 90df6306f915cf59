"""The ledger of a campaign: one SQLite file that keeps each finished chunk, its format, its checks and its mending."""

from microrad.campaign.ledger.chunk_format import Column, Head
from microrad.campaign.ledger.file import argument, is_ledger, is_written, refuse_existing
from microrad.campaign.ledger.ledger import Ledger, check_same
from microrad.campaign.ledger.mending import Verified, mend, verify

__all__ = [
    "Column",
    "Head",
    "Ledger",
    "Verified",
    "argument",
    "check_same",
    "is_ledger",
    "is_written",
    "mend",
    "refuse_existing",
    "verify",
]
