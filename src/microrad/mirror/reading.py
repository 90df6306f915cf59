"""A mirror from its file, of one axis or of several."""

from pathlib import Path

from microrad.mirror import coupled
from microrad.mirror.model import Mirror, from_table
from microrad.mission.file import holds_several_axes, load_coupled_mirror, load_mirror
from microrad.mission.toml import Fault, MissionError, clipped


def read_mirror(path: str | Path) -> Mirror:
    """Read a mirror file that `microrad identify` wrote or somebody by hand; see docs/mirror-file.md.

    A file of one axis gives the mirror in its own angle, one of several axes all of them.

    Args:
        path: The file.

    Raises:
        MissionError: With every fault of it, each with its line.

    Example:
        ```python
        import microrad

        mirror = microrad.read_mirror("loop-mirror.toml")
        print(mirror.axes, abs(mirror.frequency_response([1.0, 100.0])[:, 0, 0]))
        ```
    """
    if holds_several_axes(path):
        return coupled.of(load_coupled_mirror(path)).mirror
    table = load_mirror(path).mirror
    try:
        return from_table(table)
    except ValueError as error:
        fault = Fault("linear", "", 0, str(error), "poles that can be told apart", file=clipped(str(path)))
        raise MissionError(Path(path), [fault]) from None
