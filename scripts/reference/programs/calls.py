"""Calls of the library's functions and all numbers of what they return, a line each."""

from collections.abc import Callable
from typing import Any

from reference import told


def call(name: str, function: Callable[..., Any], *given: Any, **named: Any) -> Any:
    """Call a function, print what it returns or why it refuses, and return it.

    Args:
        name: What stands before each line.
        function: The function.
        given: Its arguments.
        named: Its arguments by name.
    """
    try:
        found = function(*given, **named)
    except (ValueError, ArithmeticError) as refused:
        print(*told.plain(f"{name}: refused: {refused}"), sep="\n")
        return None
    print(*told.flat(name, found), sep="\n")
    return found


def itself(of: Any) -> Any:
    """What is given: a record whose properties are looked at."""
    return of
