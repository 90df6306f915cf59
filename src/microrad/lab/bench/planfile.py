"""Plan files: read, checked against the plan's tables and the limits they set, and every fault reported at once."""

import difflib
from collections.abc import Iterable
from dataclasses import replace
from importlib import resources
from pathlib import Path

from microrad.lab.bench.excitation import DesignError
from microrad.lab.bench.plan import KINDS, MOST_AXES, ExcitationTable, LimitsTable, Plan, PlanTable, Record, limits_of
from microrad.mission.file import check_table
from microrad.mission.toml import Document, Fault, MissionError, UnreadableError, clipped, shown

_NAME = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_")
_MOST_EXCITATIONS = 200


class PlanError(MissionError):
    """A plan file that cannot be used: `path`, and every fault found in `faults`, by line."""


def packaged_plans() -> tuple[str, ...]:
    """Names of the plans that come with the package; `load_plan` takes them."""
    files = resources.files("microrad.lab").joinpath("plans").iterdir()
    return tuple(sorted(Path(file.name).stem for file in files if file.name.endswith(".toml")))


def load_plan(path: str | Path) -> Plan:
    """Read a plan file, or a packaged plan by its name where no such file exists, and design its excitations.

    Raises `PlanError` with every fault: what is no TOML, no key, no quantity, and each excitation that leaves a limit.
    """
    if not Path(path).exists() and str(path) in packaged_plans():
        with resources.as_file(resources.files("microrad.lab") / "plans" / f"{path}.toml") as packaged:
            return _load(packaged)
    return _load(Path(path))


def _load(path: Path) -> Plan:
    try:
        document = Document.read(path, "plan file")
    except UnreadableError as error:
        expected = error.expected if path.exists() else f"a plan file, or one of {', '.join(packaged_plans())}"
        fault = Fault("", "", 0, f"the plan file {error.reason}", expected, file=clipped(str(path)))
        raise PlanError(path, [fault]) from None
    except MissionError as error:
        raise PlanError(path, error.faults) from None
    tables = _excitation_tables(document)
    root = check_table(document, PlanTable, document.data)
    excitations = {name: _excitation(document, name, table) for name, table in tables.items()}
    truth = "" if root is None else root.bench.truth
    records = _records(document, excitations, _frame(document, root), truth)
    if root is None or document.faults:
        raise PlanError(path, document.faults)
    return Plan(root.name, root.formats, root.limits, root.bench, records, path, document.text, document.sha256)


def _excitation_tables(document: Document) -> dict[str, object]:
    """The tables [excitation.NAME]; anything else under that name is noted, and what is left can be checked."""
    found = document.data.get("excitation")
    expected = "a table [excitation.NAME] for each, NAME of letters, digits, - and _"
    if not isinstance(found, dict) or not found:
        if "excitation" not in document.damaged and not any(d.startswith("excitation.") for d in document.damaged):
            reason = "is missing" if found is None else "is not a group of named tables"
            document.fault("excitation", "", reason, expected)
        document.data["excitation"] = {}
        return {}
    if len(found) > _MOST_EXCITATIONS:
        document.fault("excitation", "", f"has {len(found)} tables", f"at most {_MOST_EXCITATIONS}")
        return {}
    for name in [name for name in found if not name or not set(name) <= _NAME or len(name) > 60]:
        document.fault(f"excitation.{name}", "", "is no name that a file can have", expected)
    return dict(found)


def _excitation(document: Document, name: str, table: object) -> ExcitationTable | None:
    """One excitation, or None with every fault in it noted."""
    key = f"excitation.{name}"
    if not isinstance(table, dict):
        document.fault(key, shown(table), "is no table", f"[{key}] with a kind and its parameters")
        return None
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        if f"{key}.kind" not in document.damaged:
            choices = " or ".join(f'kind = "{each}"' for each in KINDS)
            near = next(iter(difflib.get_close_matches(str(kind)[:60], KINDS, n=1)), "")
            reason = "is missing" if kind is None else "is none of the choices"
            value = "" if kind is None else shown(kind)
            document.fault(f"{key}.kind", value, reason, choices, nearest=near and f'"{near}"')
        return None
    return check_table(replace(document, prefix=key), KINDS[kind], table)


def _frame(document: Document, root: PlanTable | None) -> tuple[LimitsTable, int] | None:
    """Limits and number of axes where they are in order, also when something else in the file is not."""
    if root is not None:
        return root.limits, root.bench.axes
    silent = replace(document, faults=[], prefix="limits")  # what is wrong with them has been said
    limits = check_table(silent, LimitsTable, document.data.get("limits", {}))
    bench = document.data.get("bench", {})
    axes = bench.get("axes", 1) if isinstance(bench, dict) else 1
    return (limits, axes) if limits is not None and axes in range(1, MOST_AXES + 1) else None


def _records(
    document: Document, tables: dict[str, ExcitationTable | None], frame: tuple[LimitsTable, int] | None, truth: str
) -> tuple[Record, ...]:
    """Every record of every excitation that can be designed; the others are noted. `truth` is that of the bench."""
    if frame is None:
        return ()
    records: list[Record] = []
    for name, table in tables.items():
        if table is None:
            continue
        try:
            designs = table.design(name, limits_of(*frame, table.rate_hz))
        except DesignError as error:
            _note(document, name, error)
            continue
        kind = document.data["excitation"][name]["kind"]
        played = truth if table.truth == "plan" else table.truth
        records += [Record(design, kind, table.use, played, table.noise_share) for design in designs]
    _note_same_names(document, [record.excitation.name for record in records])
    return tuple(records)


def _note(document: Document, name: str, error: DesignError) -> None:
    for problem in error.problems:
        key = f"excitation.{name}.{problem.key}"
        found = document.statements.get(key)
        document.fault(key, clipped(found.value) if found else "", problem.reason, problem.expected)


def _note_same_names(document: Document, names: Iterable[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name.lower() in seen:
            document.fault("excitation", "", f'makes two records named "{name}"', "names that stay different")
        seen.add(name.lower())
