"""The evidence by subject; each file has its checks in a table at its end."""

from microrad.report.verification.check import Check


def every() -> tuple[Check, ...]:
    """All checks, in the order of the report."""
    from microrad.report.verification.checks import (
        draws,
        fades,
        ground,
        identified,
        light,
        loop,
        measured,
        operation,
        orbit,
        pointing,
        published,
        residual,
        search,
        study,
    )

    return tuple(
        c
        for room in (
            measured,
            published,
            light,
            fades,
            ground,
            pointing,
            search,
            loop,
            residual,
            orbit,
            operation,
            study,
            draws,
            identified,
        )
        for c in room.CHECKS
    )
