"""The one error that a caller of microrad may want to catch, whatever room raised it."""

from typing import ClassVar


class MicroradError(ValueError):
    """Something that was given cannot be used: the message says what, where, why and what to do.

    Each room has its own kind of it. ``page`` names the page of the documentation that says more, "" where none does.

    Example:
        ```python
        import microrad

        try:
            microrad.load_mission("no-such-mission.toml")
        except microrad.MicroradError as error:
            print(error, error.page)
        ```
    """

    page: ClassVar[str] = ""
