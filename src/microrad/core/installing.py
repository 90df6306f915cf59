"""How microrad is installed: from its folder, for its name is in no registry."""


def advice(extra: str = "", *options: str) -> str:
    """The command that installs microrad with one of its extras, and where to run it."""
    what = f"'.[{extra}]'" if extra else "."
    return f"in the project's folder: {' '.join(['pip install', *options, '--constraint constraints.txt', what])}"
