"""The budgets of a mission's links, by the mission itself."""

from microrad import link
from microrad.link import pointing


def communication(m, sources, *given, **options):
    """The budget of the communication link."""
    return link.communication_budget(link.of(m), sources, *given, **options)


def beacon(m, sources):
    """The budget of the beacon."""
    return link.beam_budget("beacon", link.Shared.of(m), m.beacon, sources)


def answer(m, sources):
    """The budget of the beacon's answer."""
    return link.beam_budget("answer", link.Shared.of(m), m.answer, sources)


def open_loop(m, sources, **options):
    """The budget of the open-loop pointing errors."""
    return pointing.open_loop_budget(m.pointing, link.Shared.of(m), m.beacon, sources, **options)
