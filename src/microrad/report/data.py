"""Plain data of records: what JSON can say."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def finite(data: Any) -> Any:
    """The same data in Python's own types, with None for a number that is not finite."""
    if isinstance(data, Mapping):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [finite(value) for value in data]
    if isinstance(data, np.generic):
        data = data.item()
    return None if isinstance(data, float) and not math.isfinite(data) else data


def fields(record: object, *names: str) -> dict[str, Any]:
    """Some fields of a record by their names.

    Args:
        record: any record.
        names: those of its fields.
    """
    return {name: getattr(record, name) for name in names}
