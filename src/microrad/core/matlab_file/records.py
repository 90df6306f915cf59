"""What the variables of a MATLAB file are, and the error that refuses one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


class MatlabFileError(ValueError):
    """Why a file is not read, and what to do about it: `remedy`, empty where the file is damaged."""

    def __init__(self, reason: str, remedy: str = "") -> None:
        """Keep the remedy beside the reason."""
        super().__init__(reason)
        self.remedy = remedy


@dataclass(frozen=True, slots=True)
class Left:
    """Numbers left in the file: shape, float, complex or bool, the variable's byte in the file, and theirs in it."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    variable: int
    offset: int


@dataclass(frozen=True, slots=True)
class Structure:
    """An array of structures: how many, the names of the fields, and the values of each by these names."""

    size: int
    names: tuple[str, ...]
    elements: tuple[dict[str, Any], ...]

    @property
    def fields(self) -> dict[str, Any]:
        """Values by name where there is one structure, else names alone."""
        return self.elements[0] if len(self.elements) == 1 else dict.fromkeys(self.names)


@dataclass(frozen=True, slots=True)
class Unread:
    """A variable that is not read: what it is, and how to save it instead, in words."""

    kind: str
    remedy: str
