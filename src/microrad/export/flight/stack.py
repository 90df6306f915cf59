"""The stack that a step of exported code takes, from what the compiler says of each function and of who calls whom."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from microrad.core.folder import scratch
from microrad.export.flight.build import FLAGS, compiler_words, run

_NODE = re.compile(r'node: \{ title: "([^"]+)" label: "[^"]*\\n(\d+) bytes \((\w+)')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')


@dataclass(frozen=True, slots=True)
class StackUse:
    """Most bytes of stack under a step, and the functions of the library that it calls, whose own stack is not in it.

    It is that of the compiler and processor here.
    """

    most_bytes: int
    library: tuple[str, ...]

    @property
    def words(self) -> str:
        """What a step takes, in a sentence."""
        behind = f", and what the C library takes in {', '.join(self.library)}" if self.library else ""
        return f"{self.most_bytes} bytes at most, from this machine's compiler{behind}"


def stack_use(folder: Path, sources: Sequence[str], step: str) -> StackUse | None:
    """The stack of a function of exported code, summed along the deepest chain of calls: none of it calls itself.

    Args:
        folder: Folder with the code.
        sources: Names of its source files, without the bench.
        step: Name of the function.

    Returns:
        None where the compiler does not tell, as all but GCC since version 10.

    Raises:
        ExportError: Where there is no compiler.
    """
    with scratch("stack") as made:
        paths = [str((folder / each).resolve()) for each in sources]
        code, _ = run((*compiler_words(), *FLAGS, "-fcallgraph-info=su", "-c", *paths), made)
        graphs = [each.read_text(encoding="utf-8") for each in sorted(made.glob("*.ci"))]
    return deepest("\n".join(graphs), step) if code == 0 and graphs else None


def deepest(graph: str, step: str) -> StackUse | None:
    """The stack of a function by the call graphs of all files, as GCC writes them (VCG).

    Args:
        graph: Their text.
        step: Name of the function.

    Returns:
        None where a function of the code has no fixed frame, or the graph does not hold the step.
    """
    own = {title: (int(size), kind) for title, size, kind in _NODE.findall(graph)}
    if step not in own or any(kind != "static" for _, kind in own.values()):
        return None
    called: dict[str, set[str]] = {}
    for source, target in _EDGE.findall(graph):
        called.setdefault(source, set()).add(target)
    reached: set[str] = set()

    @cache
    def below(function: str) -> int:
        reached.add(function)
        return own.get(function, (0, ""))[0] + max(map(below, called.get(function, ())), default=0)

    most = below(step)
    return StackUse(most, tuple(sorted(reached - set(own))))
