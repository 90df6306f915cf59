"""What the site adds to Sphinx: formulas as MathML, so that no script is needed, and examples of docstrings as code."""

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from numpy.typing import ArrayLike
from sphinx.util.typing import stringify_annotation

from microrad.core.arrays import Complexes, Floats

_BAR = '<mo stretchy="false" lspace="0" rspace="0">&#x0007C;</mo>'


def _mathml(node: nodes.Node, display: str) -> str:
    """A formula; bars about a quantity are no operators between two."""
    return re.sub(r"<mo[^>]*>&#x0007C;</mo>", _BAR, convert(node.astext(), display=display))


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(_mathml(node, "inline"))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    translator.body.append(f'<div class="math">{_mathml(node, "block")}</div>')
    raise nodes.SkipNode


def _examples(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are plain text with Markdown's fences: code becomes a block, and no sign elsewhere is markup."""
    found: list[str] = []
    fenced = False
    for line in lines:
        text = line.strip()
        if text.startswith("```"):
            if not fenced:
                indent = line[: len(line) - len(line.lstrip())]
                found += [f"{indent}.. code-block:: {text.removeprefix('```') or 'text'}", ""]
            fenced = not fenced
        else:
            found.append((f"   {line}" if text else line) if fenced else _plain(line))
    lines[:] = found


def _plain(line: str) -> str:
    """A line whose bars, stars and last underscores mean themselves, but for what stands between backticks."""
    parts = line.split("`")
    parts[::2] = [re.sub(r"([|*]|(?<=\w)_(?!\w))", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


_LONG = {
    stringify_annotation(kind, mode): name
    for name, kind in (("ArrayLike", ArrayLike), ("Floats", Floats), ("Complexes", Complexes))
    for mode in ("smart", "fully-qualified-except-typing")
}
"""Types of arrays as Sphinx spells them out, and as the code calls them."""


def _signatures(app: Any, what: str, name: str, thing: Any, options: Any, signature: str, returned: str) -> Any:
    """Signatures in which arrays have the names that they have in the code."""
    for long, short in _LONG.items():
        signature, returned = (text and text.replace(long, short) for text in (signature, returned))
    return signature, returned


def setup(app: Any) -> dict[str, bool]:
    """Make them known, the examples before napoleon reads the sections."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("autodoc-process-signature", _signatures)
    app.connect("autodoc-process-docstring", _examples, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
