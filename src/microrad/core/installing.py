"""How microrad is installed: from its folder, for its name is in no registry."""


def advice(extra: str = "", *options: str) -> str:
    """The command that installs microrad, and where to run it.

    Args:
        extra: An extra of it that is installed, too.
        options: Options of pip.
    """
    what = f"'.[{extra}]'" if extra else "."
    return f"in the project's folder: {' '.join(['pip install', *options, '--constraint constraints.txt', what])}"
