"""The root of a function of one number, without SciPy's optimisers, which take long to load."""

import math
from collections.abc import Callable


def root(
    of: Callable[[float], float], low: float, high: float, *, xtol: float = 2e-12, rtol: float = 4 * 2.0**-52
) -> float:
    """Where a function is 0 between two ends at which its signs differ.

    Brent, Algorithms for Minimization without Derivatives (1973), chapter 4, step by step as `scipy.optimize.brentq`
    takes it: the result has the same bits.

    Args:
        of: The function.
        low: One end.
        high: The other end.
        xtol: How far off the root may be.
        rtol: The same as a share of the root; at least four times the rounding of a float.

    Raises:
        ValueError: The function has the same sign at both ends, or is nan somewhere.
    """
    before, here = low, high
    of_before, of_here = _value(of, before), _value(of, here)
    if of_before == 0.0:
        return before
    if of_here == 0.0:
        return here
    if (of_before < 0.0) == (of_here < 0.0):
        raise ValueError(f"the function is {of_before:g} at {low:g} and {of_here:g} at {high:g}: no sign changes")
    across, of_across = before, of_before
    last_step = step = here - before
    while True:
        if (of_before < 0.0) != (of_here < 0.0):
            across, of_across = before, of_before
            last_step = step = here - before
        if abs(of_across) < abs(of_here):
            before, here, across = here, across, here
            of_before, of_here, of_across = of_here, of_across, of_here
        near, half = (xtol + rtol * abs(here)) / 2.0, (across - here) / 2.0
        if of_here == 0.0 or abs(half) < near:
            return here
        tried = math.inf
        if abs(last_step) > near and abs(of_here) < abs(of_before):
            if before == across:
                above, below = here - before, of_here - of_before
            else:
                rise, far = (of_before - of_here) / (before - here), (of_across - of_here) / (across - here)
                above, below = of_across * far - of_before * rise, far * rise * (of_across - of_before)
            tried = -of_here * above / below if below else math.inf
        shorter = 2.0 * abs(tried) < min(abs(last_step), 3.0 * abs(half) - near)
        last_step, step = (step, tried) if shorter else (half, half)
        before, of_before = here, of_here
        here += step if abs(step) > near else near if half > 0.0 else -near
        of_here = _value(of, here)


def _value(of: Callable[[float], float], x: float) -> float:
    found = of(x)
    if math.isnan(found):
        raise ValueError(f"the function is nan at {x:g}")
    return found
