"""The sheet of all published cases: expected and obtained digits, computed when the page is made."""

from site_pages.cases import all_cases, recorded
from site_pages.tables import code, plain, table

_HEAD = """# Validation

Each row holds the code to digits from outside: a paper, a standard, or a computation by other means. "Obtained" was
computed when this page was made. "Within" is how far the two may be apart: half of the last printed digit, or the
tolerance of the test that is named. Digits that take long are in the last table, with the command that computes them.
"""
_RECORDED = """## Recorded

What takes minutes to hours stands in a page of this site, from which the numbers here are taken.
"""


def pages() -> dict[str, str]:
    """The page of all cases."""
    parts, groups = [_HEAD], all_cases()
    total = sum(map(len, groups.values()))
    met = sum(case.met for cases in groups.values() for case in cases)
    parts.append(f"{met} of {total} cases are within their tolerance.")
    for title, cases in groups.items():
        rows = [
            (
                plain(case.name),
                plain(case.source),
                case.expected,
                case.shown,
                f"{case.difference:+.1g}" if case.difference else "0",
                f"{case.tolerance:.2g}" if case.met else f"**missed**: {case.tolerance:.2g}",
                _test(case.test),
            )
            for case in cases
        ]
        parts += [
            f"## {title}",
            table(("case", "source", "expected", "obtained", "difference", "within", "test"), rows, wide=True),
        ]
    parts += [_RECORDED, table(("case", "expected, and whose", "obtained", "page", "command"), _recorded(), wide=True)]
    return {"validation.md": "\n\n".join(parts) + "\n"}


def _test(name: str) -> str:
    """A test by its file and its sentence."""
    path, _, function = name.removeprefix("tests/").partition("::")
    return f"{code(path)}: {function.removeprefix('test_').replace('_', ' ')}"


def _recorded() -> list[tuple[str, ...]]:
    page, command = "hysteretic-stiffness.md", "benchmarks/cubespec_one_model.py"
    ours, best = recorded(page, "**mean of six**"), recorded(page, "best published model, neural, on other records")
    floor = recorded(page, "what no linear model of one amplitude could follow, rms")
    rows = [
        (
            f"CubeSpec mirror at {amplitude} mV, error on held-out records (µm)",
            f"{best[k]}, best published model, on other records; {floor[k]}, limit of a linear model of that amplitude",
            ours[k].strip("*"),
            f"[Hysteretic stiffness]({page})",
            code(command),
        )
        for k, amplitude in enumerate((100, 200, 300))
    ]
    every = recorded("identify.md", "**all parameters**")
    bars = "90 to 99 % of the truths within 1.96 errors; width at most 2"
    rows.append(
        (
            "errors of identified parameters: truths held, width over the Cramér-Rao bound",
            bars,
            f"{every[2]}; {every[3]}",
            "[Identify](identify.md)",
            code("benchmarks/error_coverage.py"),
        )
    )
    fits = {"mirror of two axes, 2 × 2": "8 states", "wide dynamic range": "5 states"}
    for name, states in fits.items():
        cells = recorded("identify.md", name)
        rows.append(
            (
                f"fit of a response table, {name}, {states}: error to the truth over that of scikit-rf",
                "at most 1",
                cells[3],
                "[Identify](identify.md)",
                code("benchmarks/frequency_response_fit.py"),
            )
        )
    plain_plant = recorded("pointing.md", "plain, as shipped but for the mirror's linear part")
    rows.append(
        (
            "LQG on the shipped plant, rms of an axis (µrad)",
            f"{plain_plant[0]}, optimum of all linear controllers",
            plain_plant[5],
            "[Pointing](pointing.md)",
            code("benchmarks/controllers.py"),
        )
    )
    return rows
