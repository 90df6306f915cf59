"""Derivatives of a mirror's output by its parameters, along the path that the mirror takes."""

from typing import Any, NamedTuple

from numpy.typing import NDArray

from microrad.core.kernels.compiler import Integers, compiled_loop, inlined
from microrad.core.kernels.plant import PlayPlant

DRIVE_FROM, BANK_FROM = range(2)  # of a parameter's place


class Tangents(NamedTuple):
    """Parameters, where each enters a `PlayPlant` along a `Path`, and the working memory of their tangents.

    The first ``places[DRIVE_FROM]`` parameters enter the state: row ``source`` of ``before`` adds to the predicted
    state, and of ``after`` to the state once the operators have moved. Both have the shape (steps, sources, 2), for the
    state ``row`` and its neighbour; with ``turned`` the pair (a, b) is (-b, a). Those up to ``places[BANK_FROM]`` enter
    the drive of operator ``row``, by column ``source`` of ``signal`` (steps, columns), and the others its output, by
    column ``source`` of ``plays``: its plays and the powers of its polynomial. ``bend`` is the slope of the
    polynomials, shape (steps, operators).

    ``x`` is the tangent of the state less what the last change of the operators did to it, E1 z: with ``held`` =
    A E1 + E_held - E1, ``strain`` = F E1 and ``through`` = C E1 + K, z then enters each product once. ``live`` are the
    operators that a parameter can move, by their number, and ``seen`` the states that any operator sees.

    The plant, the signals and the working memory share one precision; single precision is twice as fast, and enough for
    a search. The working memory has the tangents of all parameters in a row, and rows by state, operator or play; it is
    zero at the begin of a path.
    """

    plant: PlayPlant
    held: NDArray[Any]
    strain: NDArray[Any]
    through: NDArray[Any]
    live: Integers
    seen: Integers
    places: Integers
    row: Integers
    source: Integers
    turned: Integers
    before: NDArray[Any]
    after: NDArray[Any]
    signal: NDArray[Any]
    plays: NDArray[Any]
    bend: NDArray[Any]
    x: NDArray[Any]
    q: NDArray[Any]
    q_before: NDArray[Any]
    z: NDArray[Any]
    play: NDArray[Any]
    still: NDArray[Any]
    slope: NDArray[Any]
    moved: Integers


@inlined
def _add(total, gain, row):  # type: ignore[no-untyped-def]
    """total += gain row. Rows are taken out of their matrices before the loop: only then is it vectorised."""
    for p in range(total.size):
        total[p] += gain * row[p]


@inlined
def _add_all(total, gains, rows, used):  # type: ignore[no-untyped-def]
    """total += gains rows of those used, four at a time: each then costs one load, where alone two and a store."""
    whole = used.size - used.size % 4
    for e in range(0, whole, 4):
        i, j, m, n = used[e], used[e + 1], used[e + 2], used[e + 3]
        a, b, c, d = gains[i], gains[j], gains[m], gains[n]
        first, second, third, fourth = rows[i], rows[j], rows[m], rows[n]
        for p in range(total.size):
            total[p] += a * first[p] + b * second[p] + c * third[p] + d * fourth[p]
    for e in range(whole, used.size):
        _add(total, gains[used[e]], rows[used[e]])


@inlined
def _inject(t, signals, k):  # type: ignore[no-untyped-def]
    """Add what the parameters of the state contribute by themselves at step k."""
    for p in range(t.places[DRIVE_FROM]):
        i, s = t.row[p], t.source[p]
        if t.turned[p] == 1:
            t.x[i, p] -= signals[k, s, 1]
            t.x[i + 1, p] += signals[k, s, 0]
        else:
            t.x[i, p] += signals[k, s, 0]
            if signals[k, s, 1] != 0.0:  # a real pole has no neighbour
                t.x[i + 1, p] += signals[k, s, 1]


@inlined
def _tangent_predict(t):  # type: ignore[no-untyped-def]
    for i in range(0, t.x.shape[0], 2):
        keep0, keep1, cross0, cross1 = (
            t.plant.diagonal[i],
            t.plant.diagonal[i + 1],
            t.plant.coupling[i],
            t.plant.coupling[i + 1],
        )
        x0, x1 = t.x[i], t.x[i + 1]
        for p in range(x0.size):
            a, b = x0[p], x1[p]
            x0[p] = keep0 * a + cross0 * b
            x1[p] = keep1 * b + cross1 * a
        _add_all(x0, t.held[i], t.z, t.live)
        _add_all(x1, t.held[i + 1], t.z, t.live)


@inlined
def _tangent_drive(t, k):  # type: ignore[no-untyped-def]
    for e in t.live:
        q, q_before = t.q[e], t.q_before[e]
        for p in range(q.size):
            q_before[p] = q[p]
            q[p] = 0.0
        _add_all(q, t.plant.F[e], t.x, t.seen)
        _add_all(q, t.strain[e], t.z, t.live)
    for p in range(t.places[DRIVE_FROM], t.places[BANK_FROM]):
        t.q[t.row[p], p] += t.signal[k, t.source[p]]


@inlined
def _regroup(t, e, now):  # type: ignore[no-untyped-def]
    """The first ``now`` plays of operator e move from here on: those that stop keep the drive's last tangent."""
    begin, end = t.plant.play_start[e], t.plant.play_start[e + 1]
    still, q_before = t.still[e], t.q_before[e]
    for j in range(begin + now, begin + t.moved[e]):
        play = t.play[j]
        for p in range(play.size):
            play[p] = q_before[p]
    for p in range(still.size):
        still[p] = 0.0
    for j in range(begin + now, end):
        _add(still, t.plant.play_weight[j], t.play[j])
    t.slope[e] = 0.0
    for j in range(begin, begin + now):
        t.slope[e] += t.plant.play_weight[j]
    t.moved[e] = now


@inlined
def _tangent_bank(t, moved, k):  # type: ignore[no-untyped-def]
    """Plays that move and the polynomial follow the tangent of the drive; the other plays keep theirs, as a sum."""
    for e in t.live:
        if moved[k, e] != t.moved[e]:
            _regroup(t, e, moved[k, e])
        slope, z, still, q = t.slope[e] + t.bend[k, e], t.z[e], t.still[e], t.q[e]
        for p in range(z.size):
            z[p] = still[p] + slope * q[p]
    for p in range(t.places[BANK_FROM], t.row.size):
        t.z[t.row[p], p] += t.plays[k, t.source[p]]


@compiled_loop
def tangent_kernel(t, moved, begin, first, stride, output):  # type: ignore[no-untyped-def]
    """Derivative of a plant's output by parameters, along its path (forward sensitivities of the plays' exact steps).

    Starts with no tangent at step ``begin`` and runs to the end of the path. What enters the output itself (C, D, K) is
    not a parameter here.

    Args:
        t: `Tangents`, whose working memory is zero.
        moved: Plays of each operator that its drive carries along, shape (steps, operators), as a `Path` has it.
        begin: Step at which the tangents begin.
        first: First step whose derivative is wanted, no earlier than ``begin``.
        stride: Steps from one that is wanted to the next.
        output: Derivatives, shape (rows, outputs, parameters), with a row for each step that is wanted; written.
    """
    row = 0
    for k in range(begin, moved.shape[0]):
        _tangent_predict(t)
        _inject(t, t.before, k)
        _tangent_drive(t, k)
        _tangent_bank(t, moved, k)
        _inject(t, t.after, k)
        if k >= first and (k - first) % stride == 0:
            for o in range(output.shape[1]):
                total = output[row, o]
                for p in range(total.size):
                    total[p] = 0.0
                for i in range(t.x.shape[0]):
                    _add(total, t.plant.C[o, i], t.x[i])
                _add_all(total, t.through[o], t.z, t.live)
            row += 1
