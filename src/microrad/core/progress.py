"""How whatever takes long says how far it has come."""

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Called with how much is done, of how much, and of what, in words."""
