"""Tables of a mission made without a check of their values, and all that their own check then says of them."""

from microrad.mission.fields import ProblemsError


def made(table, **values):
    """A table with these values, and None for all others."""
    return table.model_construct(**dict.fromkeys(table.model_fields) | values)


def told(problems):
    """Every problem in its words, one behind the other."""
    return str(ProblemsError(*problems))


def one_line(text):
    """A text without the breaks of its lines."""
    return " ".join(text.split())
