"""Mission and mirror files: read, checked against the mission's tables, and every fault reported at once."""

import contextlib
import difflib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from microrad.core.folder import read_bytes
from microrad.core.units import UnitError
from microrad.mission import versions
from microrad.mission.fields import NOT_PUBLISHED, UNKNOWN, Problem, ProblemsError, Quantity, Several, Table
from microrad.mission.model import LinkMission, Mission, Source
from microrad.mission.origins import of_paper, written_for
from microrad.mission.tables.mirror import Mirror
from microrad.mission.toml import MAX_BYTES, Document, Fault, MissionError, UnreadableError, clipped, shown, too_large

if TYPE_CHECKING:
    from microrad.mission.tables.coupled_mirror import CoupledMirror

__all__ = [
    "Fault",
    "LinkFile",
    "MirrorFile",
    "MissionError",
    "MissionFile",
    "NamedFile",
    "assumptions",
    "changed_from_shipped",
    "content_of",
    "either_file",
    "holds_several_axes",
    "kind_of",
    "load_coupled_mirror",
    "load_link",
    "load_mirror",
    "load_mission",
    "mission_file",
    "named_files",
    "open_mission",
    "with_contents",
    "with_values",
]

_BEYOND_LINK = Mission.model_fields.keys() - LinkMission.model_fields.keys()
_MOST_MIRROR_BYTES = 4_000_000  # the covariance of hundreds of parameters
_MIRROR_LABEL = "mirror file"
_MOST_QUOTED = 1000  # characters of a value, before it is clipped
_MOST_UNKNOWN = 100  # unknown keys of one file for which a near one is looked up
_Location = tuple[int | str, ...]
_T = TypeVar("_T", bound=Table)
_File = TypeVar("_File", bound="LinkFile")

MOST_NAMED_BYTES = 100_000_000
"""Largest file that a mission names and a study reads."""


@dataclass(frozen=True, slots=True)
class MirrorFile:
    """A mirror with the path, text and SHA-256 of its file; the keys of `sources` begin with "mirror."."""

    mirror: Mirror
    path: Path
    text: str
    sha256: str
    sources: Mapping[str, Source]


@dataclass(frozen=True, slots=True)
class NamedFile:
    """A file by the name that a mission gives it, with its bytes; None where they could not be read."""

    name: str
    content: bytes | None


@dataclass(frozen=True, slots=True)
class LinkFile:
    """What a link budget needs, with the path, text and SHA-256 of its file and the source of each key.

    `contents` are those of the files that it names, once they are read (`with_contents`).
    """

    mission: LinkMission
    path: Path
    text: str
    sha256: str
    sources: Mapping[str, Source]
    contents: tuple[NamedFile, ...] = ()


@dataclass(frozen=True, slots=True)
class MissionFile(LinkFile):
    """A mission with the path, text and SHA-256 of its file, and the source of each key, "communication.distance".

    `mirror_file` is the file that the mirror came from, when it has one of its own.
    """

    mission: Mission
    mirror_file: MirrorFile | None = None


def load_mission(path: str | Path, mirror_path: str | Path | None = None, *, text: str | None = None) -> MissionFile:
    """Read a mission file and check it.

    Args:
        path: The mission file.
        mirror_path: A mirror file that replaces what the mission says about its mirror; without it, `[mirror]` may hold
            the single key `file`, the path of a mirror file as seen from the mission file.
        text: The mission as text in place of the file's content, as if it stood at `path`, which then need not exist.

    Raises:
        MissionError: With every fault of both files.

    Example:
        ```python
        import microrad

        file = microrad.load_mission("leo-geo.toml")
        print(file.mission.communication.transmit_power_w, file.sources["communication.transmit_power"])
        ```
    """
    return mission_file(open_mission(path, mirror_path, text=text))


def open_mission(path: str | Path, mirror_path: str | Path | None = None, *, text: str | None = None) -> Document:
    """Read a mission file as it stands, its mirror file taken in, for `mission_file`; nothing but its TOML is checked.

    Args:
        path: The mission file.
        mirror_path: A mirror file that replaces what the mission says about its mirror.
        text: The mission as text in place of the file's content, as if it stood at `path`.

    Raises:
        MissionError: When it is no TOML.
    """
    document = _open(Path(path), "mission file", "", text)
    _take_in_mirror(document, None if mirror_path is None else Path(mirror_path))
    return document


def with_values(document: Document, data: Mapping[str, Any], mirror_path: Path | None = None) -> Document:
    """The document with other data in place of its own, and with the mirror of another file; its faults are kept.

    Args:
        document: The document, which stays as it is.
        data: The data in place of its own.
        mirror_path: A mirror file that replaces what the data says about the mirror, None for none.
    """
    inner = {name: replace(each, faults=list(each.faults)) for name, each in document.inner.items()}
    other = replace(document, data=dict(data), faults=list(document.faults), inner=inner)
    if mirror_path is not None:
        _take_in_mirror(other, mirror_path)
    return other


def mission_file(document: Document) -> MissionFile:
    """The mission of a document. Raises `MissionError` with every fault of it and of its mirror file."""
    mission = check_table(document, Mission, document.data)
    if mission is None or document.all_faults():
        raise MissionError(document.path, document.all_faults())
    inner = document.inner.get("mirror")
    mirror_file = _mirror_file(inner, mission.mirror) if inner else None
    sources = _sources(document)
    return MissionFile(mission, document.path, document.text, document.sha256, sources, mirror_file=mirror_file)


def either_file(document: Document) -> LinkFile:
    """The mission of a document: a `MissionFile`, or a `LinkFile` where it has no table but those of the links.

    Raises `MissionError` with every fault of it and of its mirror file.
    """
    if kind_of(document.data) is Mission:
        return mission_file(document)
    mission = check_table(document, LinkMission, document.data)
    if mission is None or document.faults:
        raise MissionError(document.path, document.faults)
    return LinkFile(mission, document.path, document.text, document.sha256, _sources(document))


def kind_of(data: Mapping[str, Any]) -> type[LinkMission]:
    """What the raw data of a file are read as: a whole mission, or its links alone."""
    return Mission if _BEYOND_LINK & data.keys() else LinkMission


def named_files(m: LinkMission) -> tuple[str, ...]:
    """Files that the mission names beside its mirror, as it names them: seen from the mission file."""
    tables = [] if m.orbit is None else [m.orbit.leo, m.orbit.geo]
    named = [t.file for t in tables] + [None if m.constellation is None else m.constellation.file]
    named.append(None if m.communication.fading is None else m.communication.fading.series)
    if isinstance(m, Mission) and m.fine_pointing is not None:
        named += [m.fine_pointing.vibration.file, m.fine_pointing.mirror_file]
    return tuple(name for name in dict.fromkeys(named) if name is not None)


def with_contents(file: _File) -> _File:
    """The mission file with the content of the files that it names: each is read once, whatever becomes of it later.

    One that cannot be read, or is too large, is left to whoever needs it, who says what is wrong.
    """
    names = named_files(file.mission)
    return replace(file, contents=tuple(NamedFile(name, _content(file.path.parent / name)) for name in names))


def _content(path: Path) -> bytes | None:
    try:
        data = read_bytes(path, MOST_NAMED_BYTES + 1) if path.is_file() else None
    except (OSError, ValueError):  # the last for a name that holds a NUL
        return None
    return data if data is not None and len(data) <= MOST_NAMED_BYTES else None


def content_of(name: str, contents: tuple[NamedFile, ...]) -> bytes | None:
    """What a file that a mission names held when it was read; None where it is to be read now.

    Args:
        name: Name of the file, as the mission gives it.
        contents: The files whose content is known.
    """
    return next((each.content for each in contents if each.name == name), None)


def load_link(path: str | Path, *, text: str | None = None) -> LinkFile:
    """Read a file for its links alone: a whole mission, or one without the tables on mirror, loop and scenario.

    Args:
        path: The mission file.
        text: The mission as text in place of the file's content, as if it stood at `path`.

    Raises:
        MissionError: With every fault of the file.
    """
    return either_file(open_mission(path, text=text))


def load_mirror(path: str | Path) -> MirrorFile:
    """Read a mirror file: the keys of a mission's `[mirror]` table at the root of a file of their own.

    Raises `MissionError` with every fault of it.
    """
    document = _open_mirror(Path(path))
    mirror = check_table(document, Mirror, document.data)
    if mirror is None or document.faults:
        raise MissionError(document.path, document.faults)
    return _mirror_file(document, mirror)


def holds_several_axes(path: str | Path) -> bool:
    """Whether a mirror file says that it is of version 2, for `load_coupled_mirror`; nothing else of it is checked.

    Args:
        path: The mirror file.

    Raises:
        MissionError: When it cannot be read, or is no TOML.
    """
    version = _open(Path(path), _MIRROR_LABEL, "mirror").data.get("version")
    return type(version) is int and version == 2


def load_coupled_mirror(path: str | Path, *, text: str | None = None) -> "CoupledMirror":
    """Read a mirror file of version 2, of several axes; `microrad.mirror.coupled.of` makes a mirror of the table.

    Args:
        path: The mirror file.
        text: Its text in place of the file's content, as if it stood at `path`, which then need not exist.

    Raises:
        MissionError: With every fault of it.
    """
    from microrad.mission.tables.coupled_mirror import CoupledMirror

    document = _open(Path(path), _MIRROR_LABEL, "mirror", text)
    if not versions.is_of_several_axes(document):
        raise MissionError(document.path, document.faults)
    mirror = check_table(document, CoupledMirror, document.data)
    if mirror is None or document.faults:
        raise MissionError(document.path, document.faults)
    return mirror


def load_loop(path: str | Path, mirror_path: str | Path | None = None) -> "tuple[MissionFile, CoupledMirror | None]":
    """Read a mission for its fine-pointing loop, with the mirror of several axes that the loop has, if it is one.

    Args:
        path: The mission file.
        mirror_path: A mirror file: of one axis it replaces what the mission says about its mirror, of several axes that
            of the loop.

    Raises:
        MissionError: With every fault of both files.
    """
    if mirror_path is not None and holds_several_axes(mirror_path):
        return load_mission(path), load_coupled_mirror(mirror_path)
    mission = load_mission(path, mirror_path)
    return mission, mirror_of_loop(mission)


def mirror_of_loop(file: MissionFile) -> "CoupledMirror | None":
    """The mirror of several axes that a mission's fine-pointing loop has, or None: its mirror on each axis.

    Args:
        file: The mission.

    Raises:
        MissionError: With every fault of the mirror file.
    """
    table = file.mission.fine_pointing
    if table is None or table.mirror_file is None:
        return None
    held = content_of(table.mirror_file, file.contents)
    text = None if held is None else held.decode("utf-8", "surrogateescape")
    return load_coupled_mirror(file.path.parent / table.mirror_file, text=text)


def assumptions(sources: Mapping[str, Source]) -> tuple[tuple[str, str, str], ...]:
    """Key, raw value and source of every value whose comment calls it an assumption, or derived from others."""
    chosen = ("assumption", "derived")
    return tuple((key, source.value, source.text) for key, source in sources.items() if source.kind in chosen)


# --------------------------------------------------------------------------------------------------------------- files
def _open(path: Path, label: str, prefix: str, text: str | None = None) -> Document:
    try:
        names = _names_in_mirror_files() if prefix else _names_within(Mission)
        named = (path, label, prefix, names | {"file"}, _MOST_MIRROR_BYTES if prefix else MAX_BYTES)
        if text is not None:
            return Document.of(text.encode("utf-8", "surrogatepass"), *named)
        return Document.read(*named)
    except UnreadableError as error:
        raise _unreadable(path, label, error) from None


def _names_in_mirror_files() -> frozenset[str]:
    from microrad.mission.tables.coupled_mirror import CoupledMirror

    return _names_within(Mirror) | _names_within(CoupledMirror)


def _unreadable(path: Path, label: str, error: UnreadableError) -> MissionError:
    expected = error.expected
    if label == _MIRROR_LABEL:
        expected = expected.replace("`microrad init` writes one to start from", "`microrad identify` writes one")
    fault = Fault("", "", 0, f"the {label} {error.reason}", expected, file=clipped(str(path)))
    return MissionError(path, [fault])


def _open_mirror(path: Path) -> Document:
    """The mirror file of one axis; raises `MissionError` where it holds several, or is no mirror file."""
    document = _open(path, _MIRROR_LABEL, "mirror")
    if not versions.is_of_one_axis(document, document.data):
        raise MissionError(document.path, document.faults)
    if len(document.text) > MAX_BYTES:
        raise _unreadable(path, _MIRROR_LABEL, too_large(MAX_BYTES))
    return document


def _take_in_mirror(document: Document, given: Path | None) -> None:
    """Put the mirror file's data where the mission has its mirror, if one is named here or in the mission."""
    table = document.data.get("mirror")
    path = given or _named_file(document, table)
    if path is None:
        if isinstance(table, dict) and "file" not in table and not versions.is_of_one_axis(document, table):
            _leave_out_mirror(document)
        return
    try:
        inner = _open_mirror(path)
    except MissionError as error:
        document.faults.extend(error.faults)
        _leave_out_mirror(document)
        return
    document.inner["mirror"] = inner
    document.data["mirror"] = inner.data


def _leave_out_mirror(document: Document) -> None:
    document.damaged.add("mirror")
    document.data.pop("mirror", None)


def _named_file(document: Document, table: object) -> Path | None:
    """Path of the mirror file that `[mirror]` names, or None; a `file` that names none is noted and taken out."""
    if not isinstance(table, dict) or "file" not in table:
        return None
    file = table["file"]
    if len(table) == 1 and isinstance(file, str) and file:
        return document.path.parent / file
    reason = "is no path" if len(table) == 1 else "stands beside other keys of the mirror"
    document.fault(
        "mirror.file", shown(file), reason, 'file = "mirror.toml" alone in [mirror], or all of its other keys'
    )
    _leave_out_mirror(document)
    return None


def _mirror_file(document: Document, mirror: Mirror) -> MirrorFile:
    return MirrorFile(mirror, document.path, document.text, document.sha256, _sources(document))


def _sources(document: Document) -> dict[str, Source]:
    """Source of each key that holds a value; a key in an inline table has the source of that table."""
    sources = {}
    for key in _leaves(document.data, document.prefix):
        holder = document.holder(key)
        found = holder.statement(key)
        value, line, comment = (" ".join(found.value.split()), found.line, found.comment) if found else ("", 0, "")
        was = written_for(found.key, comment, found.value) if found else ""
        sources[key] = Source(line, comment, value, holder.label, was)
    return sources


def _leaves(data: Mapping[str, Any], table: str) -> Iterator[str]:
    for name, value in data.items():
        key = _dotted(table, (name,))
        if isinstance(value, dict):
            yield from _leaves(value, key)
        else:
            yield key


# --------------------------------------------------------------------------------------------------------- validating
def check_value(document: Document, table: type[Table], key: str, value: object) -> bool:
    """Whether a value fits a key of a table by itself; what is wrong with it is noted in the document.

    Args:
        document: The document, whose prefix is the dotted key of the table.
        table: The table that has the key.
        key: The key, as a file calls it.
        value: The value, as a file holds it.
    """
    try:
        table.model_validate({key: value})
    except ValidationError as error:
        own = [d for d in error.errors(include_url=False) if d["loc"][:1] == (key,)]
        _Report(document, table).note(own)
        return not own
    return True


def check_table(document: Document, model: type[_T], data: Mapping[str, Any]) -> _T | None:
    """The data as a record, or None with every fault in it noted in the document.

    Args:
        document: The document that the data stands in.
        model: The record that the data is to become.
        data: The data, as a file holds it.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        details = error.errors(include_url=False)
    report = _Report(document, model)
    report.note(details)
    if isinstance(data, dict):
        sound = report.sound(model, data)
        if issubclass(model, LinkMission):
            _check_relations(document, model, sound)
    return None


def _check_relations(document: Document, model: type[LinkMission], sound: Table) -> None:
    """Note what does not fit between tables, as far as they are in order."""
    for names, check in model.relations():
        for problem in _as_far(check, sound, names):
            _note_problem(document, problem.key, problem, "")


def _as_far(check: Callable[..., Iterator[Problem]], sound: Table, names: Iterable[str] = ()) -> Iterator[Problem]:
    """The problems of what is in order, as far as they can be told: the rest is no attribute of it."""
    with contextlib.suppress(AttributeError):
        yield from check(*(getattr(sound, name) for name in names))


def _note_problem(document: Document, key: str, problem: Problem, value: str) -> None:
    found = document.holder(key).statements.get(key)
    raw = clipped(" ".join(found.value[:_MOST_QUOTED].split())) if found and found.kind == "key" else value
    document.fault(key, raw, problem.reason, problem.expected)


class _Report:
    """Turns what pydantic finds in a table into faults in the user's words."""

    def __init__(self, document: Document, model: type[Table]) -> None:
        self.document = document
        self.model = model

    def note(self, details: Iterable[Any]) -> None:
        """Note a fault for each detail; a missing key that a misspelled one resembles is said once."""
        by_kind: dict[str, list[Any]] = {"missing": [], "extra_forbidden": []}
        for detail in details:
            by_kind.setdefault(detail["type"], []).append(detail)
        missing = {self._key(detail["loc"]): detail["loc"] for detail in by_kind.pop("missing")}
        missing = {key: place for key, place in missing.items() if not self._is_damaged(key)}
        for detail in by_kind.pop("extra_forbidden")[:_MOST_UNKNOWN]:
            missing.pop(self._note_unknown(detail["loc"], detail["input"], missing), None)
        for key, location in missing.items():
            self.document.fault(key, "", "is missing", _expected(self._table(location), str(location[-1])))
        for detail in (detail for details in by_kind.values() for detail in details):
            self._note_value(detail)

    def sound(self, table: type[Table], data: Mapping[str, Any], at: _Location = ()) -> Table:
        """The part of a table that is in order, other keys left out; what does not fit together there is noted.

        Pydantic asks a table whether it fits together when all of its keys are in order, and no sooner.

        Args:
            table: The table that the data stands for.
            data: The data, as a file holds it.
            at: Keys that lead from the document's root to the table.
        """
        try:
            return table.model_validate(data)
        except ValidationError as error:
            details = error.errors(include_url=False)
        wrong = {str(detail["loc"][0]) for detail in details if detail["loc"]}
        absent = _keys_of(table) - data.keys()
        meant = {_nearest(key, absent) for key in data.keys() - _keys_of(table)}
        values: dict[str, Any] = {}
        for name, info in table.model_fields.items():
            key = info.alias or name
            inner = _table_at(table, (key,))
            if key in absent:
                if not (info.is_required() or key in meant or self._is_damaged(self._key((*at, key)))):
                    values[name] = info.get_default()
            elif isinstance(data[key], dict) and inner in _kinds(info):
                values[name] = self.sound(inner, data[key], (*at, key))
            elif key not in wrong:
                kind: Any = Annotated[info.annotation, *info.metadata] if info.metadata else info.annotation
                values[name] = TypeAdapter(kind).validate_python(data[key])
        found = table.model_construct()
        found.__dict__.clear()
        found.__dict__.update(values)
        problems = [] if issubclass(table, LinkMission) else list(_as_far(found.problems, found))
        for problem in problems:
            key = problem.key.partition(".")[0]
            found.__dict__.pop(next((n for n, i in table.model_fields.items() if (i.alias or n) == key), ""), None)
            if wrong:  # else pydantic has told it
                _note_problem(self.document, self._key((*at, *problem.key.split("."))), problem, "")
        return found

    def _key(self, location: _Location) -> str:
        return _dotted(self.document.prefix, location)

    def _table(self, location: _Location) -> type[Table]:
        return _table_at(self.model, location[:-1])

    def _is_damaged(self, key: str) -> bool:
        damaged = self.document.holder(key).damaged | self.document.damaged
        return any(key == other or key.startswith(f"{other}.") for other in damaged if other)

    def _note_unknown(self, location: _Location, value: object, missing: Iterable[str]) -> str:
        """Note an unknown key; returns the missing key that it probably stands for, or ""."""
        table, name = self._key(location[:-1]), str(location[-1])
        keys = _keys_of(self._table(location))
        # a key that is still missing is the likelier one to have been meant
        absent = [key for key in keys if _dotted(table, (key,)) in missing]
        nearest = _nearest(name, absent) or _nearest(name, keys)
        where = f"[{table}]" if table else f"the {self.document.label}"
        expected = f"one of {', '.join(keys)}"
        self.document.fault(self._key(location), shown(value), f"is no key of {where}", expected, nearest=nearest)
        return _dotted(table, (nearest,)) if nearest in absent else ""

    def _note_value(self, detail: Any) -> None:
        """Note a value that pydantic, or a check of ours within it, refuses."""
        location, value = detail["loc"], detail["input"]
        key, cause = self._key(location), detail.get("ctx", {}).get("error")
        if isinstance(cause, ProblemsError):
            if location or not issubclass(
                self.model, LinkMission
            ):  # those of the whole mission are left to _check_relations
                for problem in cause.problems:
                    whole = _dotted(key, (problem.key,))
                    if not self._is_damaged(whole):
                        _note_problem(self.document, whole, problem, "" if problem.key else shown(value))
        elif isinstance(cause, UnitError):
            line = _line(location[-1], cause.example)
            self.document.fault(key, shown(value), cause.reason, f"{cause.expected}; for example {line}")
        else:
            self._note_kind(key, location, detail)

    def _note_kind(self, key: str, location: _Location, detail: Any) -> None:
        value = detail["input"]
        if not location:
            self.document.fault(key, shown(value), "is no table", f"[{key}], once, with its keys below it")
            return
        table, name = self._table(location), str(location[-1])
        choices = _choices(table, name)
        nearest = _nearest(value, choices) if isinstance(value, str) else ""
        most = detail.get("ctx", {}).get("max_length") if isinstance(value, str) else None
        reason = "is none of the choices" if choices else "is of the wrong kind"
        if value == "" and not choices:
            reason = "is empty"
        elif most is not None:
            reason = f"has {len(value)} characters"
        if value == UNKNOWN:
            reason = NOT_PUBLISHED
        self.document.fault(key, shown(value), reason, _expected(table, name, most), nearest=nearest and f'"{nearest}"')


def _line(name: object, example: str) -> str:
    """A line that could stand in the file; lists and plain numbers have no quotes."""
    bare = example.startswith("[") or " " not in example
    return f"{name} = {example}" if bare else f'{name} = "{example}"'


def _nearest(name: str, names: Iterable[str]) -> str:
    return next(iter(difflib.get_close_matches(name[:60], list(names), n=1)), "")


def _keys_of(table: type[Table]) -> list[str]:
    return [info.alias or name for name, info in table.model_fields.items()]


@cache
def _names_within(table: type[Table]) -> frozenset[str]:
    """Every key of a table and of those within it."""
    inner = (_table_at(table, (key,)) for key in _keys_of(table))
    return frozenset(_keys_of(table)).union(*(_names_within(each) for each in inner if each is not table))


def _info(table: type[Table], key: str) -> FieldInfo | None:
    return next((info for name, info in table.model_fields.items() if (info.alias or name) == key), None)


def _kinds(info: FieldInfo) -> tuple[Any, ...]:
    """What a key may hold: its kind, or those of a union."""
    return get_args(info.annotation) if get_origin(info.annotation) in (Union, UnionType) else (info.annotation,)


def _table_at(table: type[Table], location: _Location) -> type[Table]:
    """The table that a location inside `table` names."""
    for part in location:
        info = _info(table, str(part))  # None for the name of a table among others of its kind
        kinds = (info.annotation, *get_args(info.annotation)) if info else ()
        table = next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, Table)), table)
    return table


def _choices(table: type[Table], key: str) -> tuple[str, ...]:
    info = _info(table, key)
    kinds = (info.annotation, *get_args(info.annotation)) if info else ()
    return next((get_args(kind) for kind in kinds if get_origin(kind) is Literal), ())


def _expected(table: type[Table], key: str, most: int | None = None) -> str:
    """What a key of a table may hold, with a line that could stand there; of a text the most characters, if limited."""
    info = _info(table, key)
    rules = [rule for rule in (info.metadata if info else ()) if isinstance(rule, Quantity | Several)]
    if rules:
        return f"{rules[0].wanted}; for example {_line(key, rules[0].example)}"
    if choices := _choices(table, key):
        return " or ".join(f'{key} = "{choice}"' for choice in choices)
    inner = _table_at(table, (key,))
    if inner is not table:
        return f"a table with the keys {', '.join(_keys_of(inner))}"
    limit = "" if most is None else f", at most {most} characters"
    return f'text in quotes{limit}, for example {key} = "a name"'


def _dotted(table: str, location: Iterable[object]) -> str:
    return ".".join(str(part) for part in (table, *location) if part != "")


def changed_from_shipped(sources: Mapping[str, Source]) -> tuple[tuple[str, str, str], ...]:
    """Keys that name the paper as their source but differ from the paper's mission: (key, value, value there)."""
    named = {key: source.value for key, source in sources.items() if source.kind == "paper"}
    return tuple((key, value, there) for key, value in named.items() if (there := of_paper(key, value)))
