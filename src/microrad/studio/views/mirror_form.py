"""The form of an identification: what a recording says of itself, what is typed, and the job that comes of it."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from pydantic import TypeAdapter

from microrad.core.folder import write_whole
from microrad.core.units import UnitError, parse_quantity
from microrad.lab.recording import ACCEPTABLE, stated_units
from microrad.report.quantities import counted
from microrad.studio.commands import Action, identify
from microrad.studio.guard import plain_files
from microrad.studio.guard.names import NameRefusedError, safe_name, typed_words
from microrad.studio.jobs.queue import Order
from microrad.studio.recordings.reading import Columns, Listing

DRIVE_UNITS = ("V", "mV")
OUTPUT_UNITS = ("mrad", "urad", "rad", "um", "mm", "m")
LENGTHS = ("um", "mm", "m")
_WRITTEN = {"urad": "µrad", "um": "µm"}
_CHOSEN = 200
_IN_THE_FORM = (
    (re.compile(r"give the rate \(--rate, rate_hz\) in Hz, or name the time column \(time\)"), "type the sample rate"),
    (
        re.compile(r"To take it on as it is: --accept .* \(in Python accept=.*\)"),
        'To take it on as it is, choose it at "Go on in spite of"',
    ),
)
_DRIVES = re.compile(r"\b(u|drive|input|command|voltage|in|ch0|v)\b|volt|drive", re.IGNORECASE)
_OUTPUTS = re.compile(r"\b(y|output|out|angle|tilt|sensor|displacement|position)\b|angle|disp", re.IGNORECASE)


class SettingError(ValueError):
    """Something in the form that cannot be used; the message names the field and says what to type."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What the form says, as it is typed: channels by number, quantities as text, "" where nothing is said."""

    drive: int | None = None
    output: int | None = None
    rate: str = ""
    drive_unit: str = "V"
    output_unit: str = "mrad"
    lever_arm: str = ""
    accept: tuple[str, ...] = ()
    static: bool = False
    admissible: bool = False
    name: str = "mirror"


@dataclass(frozen=True, slots=True)
class Dropped:
    """A recording that was dropped: its key among the uploads, its name, its path, and what it is used for.

    `listing` holds its channels, where somebody has looked into it already.
    """

    key: str
    name: str
    path: Path
    use: str = "fit"
    listing: Listing | None = None


USES = {"fit": "fit", "check": "check only", "leave": "leave out"}
"""What a recording may serve for; "check" is a recording that no fit sees."""


@dataclass(frozen=True, slots=True)
class Form:
    """The form as every tab sees it; `uses` holds what is not to be fitted, by the key of the upload.

    `seen` is the key of the recording that is shown, and that the setting is for. `chosen` is what somebody has set, by
    the channels that it was set for: they are guessed anew for others.
    """

    setting: Setting = field(default_factory=Setting)
    uses: dict[str, str] = field(default_factory=dict)
    seen: str = ""
    chosen: dict[str, str] = field(default_factory=dict)


def kept_form(path: Path) -> Form:
    """The form that was kept in a file; an empty one where there is none, or none that can be read."""
    with suppress(OSError, ValueError):
        return _possible(TypeAdapter(Form).validate_json(plain_files.content(path)))
    return Form()


def _possible(form: Form) -> Form:
    """The form with what can be chosen alone: the folder, and the file in it, may have come from a stranger."""
    s = form.setting
    setting = replace(
        s,
        drive=s.drive if s.drive is not None and s.drive >= 0 else None,
        output=s.output if s.output is not None and s.output >= 0 else None,
        drive_unit=s.drive_unit if s.drive_unit in DRIVE_UNITS else "V",
        output_unit=s.output_unit if s.output_unit in OUTPUT_UNITS else "mrad",
        accept=tuple(each for each in s.accept if each in ACCEPTABLE),
    )
    return replace(form, setting=setting, uses={key: use for key, use in form.uses.items() if use in USES})


def keep_form(path: Path, form: Form) -> None:
    """Keep the form for a reload and for other tabs. Raises OSError.

    Args:
        path: the file.
        form: what it is to hold.
    """
    write_whole(path, json.dumps(asdict(form)))


def first_setting(listing: Listing, file: str) -> Setting:
    """What a recording says of itself: channels by their names and units, its rate where it states one.

    Args:
        listing: channels of the recording.
        file: its name.
    """
    usable = [k for k, channel in enumerate(listing.channels) if k != listing.time and channel.samples != 0]
    drive = _guess(listing, usable, _DRIVES, DRIVE_UNITS)
    drive = next(iter(usable), None) if drive is None else drive
    rest = [k for k in usable if k != drive]
    output = _guess(listing, rest, _OUTPUTS, OUTPUT_UNITS)
    output = next(iter(rest), None) if output is None else output
    rate = f"{listing.rates_hz[0]:.10g} Hz" if len(listing.rates_hz) == 1 else ""
    return Setting(
        drive,
        output,
        rate,
        _stated(listing, drive, DRIVE_UNITS) or "V",
        _stated(listing, output, OUTPUT_UNITS) or "mrad",
        name=f"{Path(file).stem[:100]}-mirror",
    )


# ------------------------------------------------------------------------------------------------ another recording
def shown(form: Form, listing: Listing, key: str, name: str, *, alone: bool = False) -> Form:
    """The form for another recording: channels, units and rate are guessed, unless they were set for such channels.

    Args:
        form: as it is.
        listing: channels of the recording that is to be shown.
        key: that of the upload.
        name: that of the file.
        alone: whether nothing is left of what the form said of recordings before.
    """
    first = first_setting(listing, name)
    if alone:
        return replace(form, setting=first, seen=key, chosen={})
    if key == form.seen:
        return form
    drive, output = (_channel(form, listing, which, getattr(first, which)) for which in ("drive", "output"))
    setting = replace(
        form.setting,
        drive=drive,
        output=output,
        rate=form.chosen.get(f"{_about(listing)} rate", first.rate),
        drive_unit=_unit(form, listing, "drive_unit", drive),
        output_unit=_unit(form, listing, "output_unit", output),
    )
    return replace(form, setting=setting, seen=key)


def edited(form: Form, listing: Listing | None, setting: Setting) -> Form:
    """The form as somebody has changed its setting; a channel that was changed brings its unit along.

    Without the channels of the recording that is shown, those of the form stay.

    Args:
        form: as it was.
        listing: channels of the recording that is shown, None while they are not known.
        setting: what the form says now.
    """
    old = form.setting
    if listing is None:
        return replace(form, setting=replace(setting, drive=old.drive, output=old.output))
    known = {**form.chosen, **_set(old, listing, setting)}
    form = replace(form, chosen=dict(list(known.items())[-_CHOSEN:]))
    drive_unit, output_unit = setting.drive_unit, setting.output_unit
    if setting.drive != old.drive and drive_unit == old.drive_unit:
        drive_unit = _unit(form, listing, "drive_unit", setting.drive)
    if setting.output != old.output and output_unit == old.output_unit:
        output_unit = _unit(form, listing, "output_unit", setting.output)
    return replace(form, setting=replace(setting, drive_unit=drive_unit, output_unit=output_unit))


def _set(old: Setting, listing: Listing, new: Setting) -> dict[str, str]:
    """What somebody has set, by the channels of the recording that is shown; a unit counts for other channels, too."""
    about = _about(listing)
    changed = {which for which, value in asdict(new).items() if value != getattr(old, which)}
    said = {f"{about} {which}": str(getattr(new, which)) for which in ("drive", "output", "rate") if which in changed}
    for which, channel, unit in (
        ("drive_unit", new.drive, new.drive_unit),
        ("output_unit", new.output, new.output_unit),
    ):
        if which in changed:
            said |= {f"{about} {channel} {which}": unit, which: unit}
    return said


def _about(listing: Listing) -> str:
    """What tells the channels of a file from others: names, units, and the rates that it states."""
    told = [[each.name, each.unit] for each in listing.channels], listing.rates_hz
    return hashlib.sha256(json.dumps(told).encode("ascii")).hexdigest()[:16]


def _channel(form: Form, listing: Listing, which: str, otherwise: int | None) -> int | None:
    said = form.chosen.get(f"{_about(listing)} {which}", "")
    return int(said) if said.isascii() and said.isdigit() and int(said) < len(listing.channels) else otherwise


def _unit(form: Form, listing: Listing, which: str, channel: int | None) -> str:
    """The unit of a channel: as it was set for this one, as the file states it, or as it was set for others."""
    units, otherwise = (DRIVE_UNITS, "V") if which == "drive_unit" else (OUTPUT_UNITS, "mrad")
    own = form.chosen.get(f"{_about(listing)} {channel} {which}", "")
    said = own, _stated(listing, channel, units), form.chosen.get(which, ""), otherwise
    return next(unit for unit in said if unit in units)


def _guess(listing: Listing, among: Sequence[int], names: re.Pattern[str], units: Sequence[str]) -> int | None:
    """The first channel whose unit or name speaks for it."""
    by_unit = [k for k in among if _stated(listing, k, units)]
    by_name = [k for k in among if names.search(listing.channels[k].name.replace("_", " "))]
    return next(iter([k for k in by_unit if k in by_name] or by_unit or by_name), None)


def _stated(listing: Listing, channel: int | None, units: Sequence[str]) -> str:
    """The unit that a file states for a channel, or behind its name in brackets; "" for none of these."""
    if channel is None:
        return ""
    return next((unit for unit in _said(listing, channel) if unit in units), "")


def _said(listing: Listing, channel: int) -> set[str]:
    found = listing.channels[channel]
    return stated_units((found.unit,), (found.name,))


def labels(listing: Listing) -> dict[int, str]:
    """The channels by number, with name, unit and length, for a choice."""
    return {k: _label(k, c.name, c.unit, c.samples) for k, c in enumerate(listing.channels)}


def _label(number: int, name: str, unit: str, samples: int | None) -> str:
    told = f" ({unit})" if unit and not name.endswith((f"({unit})", f"[{unit}]")) else ""
    length = "" if samples is None else f", {counted(samples, 'sample')}"
    own = f"column {number}" if name in ("", str(number)) else f"{number}: {name}"
    return f"{own}{told}{length}"


def rate_hz(typed: str) -> float | None:
    """A sample rate as it is typed, with its unit or without; None for nothing. Raises `SettingError`."""
    if not typed.strip():
        return None
    text = typed.strip()
    with suppress(ValueError):
        float(text)
        text = f"{text} Hz"
    try:
        found = parse_quantity(text, "Hz")
    except UnitError as error:
        raise SettingError(f"sample rate: {error}") from None
    if not found > 0.0:
        raise SettingError(f"sample rate: {typed} is not above 0; type a rate such as 5 kHz")
    return found


def lever_arm_m(setting: Setting) -> float | None:
    """The lever arm of a displacement; None for an angle. Raises `SettingError`."""
    if setting.output_unit not in LENGTHS:
        return None
    if not setting.lever_arm.strip():
        raise SettingError(
            f"lever arm: the output is a length ({written(setting.output_unit)}) and a mirror needs an angle; type the "
            'distance from the axis of rotation to the point measured, such as "50 mm"'
        )
    try:
        found = parse_quantity(setting.lever_arm.strip(), "m")
    except UnitError as error:
        raise SettingError(f"lever arm: {error}") from None
    if not found > 0.0:
        raise SettingError(f"lever arm: {setting.lever_arm} is not above 0; type a length such as 50 mm")
    return found


def columns(setting: Setting) -> Columns:
    """Which channels are read. Raises `SettingError` where they are not chosen, or chosen twice."""
    if setting.drive is None or setting.output is None:
        missing = "drive" if setting.drive is None else "output"
        raise SettingError(f"{missing}: choose the channel")
    if setting.drive == setting.output:
        raise SettingError(f"output: channel {setting.output} is the drive already; choose the channel of the sensor")
    return Columns((setting.drive,), (setting.output,), rate_hz(setting.rate), accept=setting.accept)


def in_the_form(words: str) -> str:
    """The reader's words, which name options of the command, as they are for somebody before the form."""
    for pattern, instead in _IN_THE_FORM:
        words = pattern.sub(instead, words)
    return words


def written(unit: str) -> str:
    """A unit as it is read, not typed."""
    return _WRITTEN.get(unit, unit)


def identification(folder: Path, recordings: Sequence[Dropped], setting: Setting) -> Action:
    """The identification that the form asks for, seen from the working folder.

    Raises `SettingError` for what is missing in it, for units that a recording denies, and for a mirror file that is
    there already.

    Args:
        folder: the working folder.
        recordings: what was dropped.
        setting: what the form says.
    """
    chosen = columns(setting)
    for each in recordings:
        if each.use != "leave" and each.listing is not None:
            _agree(each.name, each.listing, setting)
    fitted = tuple(each.path.relative_to(folder) for each in recordings if each.use == "fit")
    if not fitted:
        raise SettingError("recordings: none is to be fitted; drop one, or set its use to fit")
    return identify(
        fitted,
        str(chosen.inputs[0]),
        str(chosen.outputs[0]),
        _new_file(folder, setting.name),
        units=(setting.drive_unit, setting.output_unit),
        rate_hz=chosen.rate_hz,
        accept=setting.accept,
        validate=tuple(each.path.relative_to(folder) for each in recordings if each.use == "check"),
        lever_arm_m=lever_arm_m(setting),
        static=setting.static,
        admissible=setting.admissible,
        name=setting.name.strip(),
    )


def _agree(name: str, listing: Listing, setting: Setting) -> None:
    """Raises `SettingError` for a unit other than the file states: the mirror would be larger or smaller than it is."""
    for which, channel, unit in (
        ("drive", setting.drive, setting.drive_unit),
        ("output", setting.output, setting.output_unit),
    ):
        said = _said(listing, channel) if channel is not None and channel < len(listing.channels) else set()
        if said and said != {unit}:
            raise SettingError(
                f"unit of the {which}: the form says {written(unit)} and {name} says "
                f"{', '.join(map(written, sorted(said)))}; choose what the file says, or set its use to leave out"
            )


def _new_file(folder: Path, name: str) -> Path:
    """The mirror file of this name, which neither it nor its report may be there already."""
    if not name.strip():
        raise SettingError("name of the mirror: it has none; type one, such as stage-x")
    try:
        path = Path(safe_name(f"{name.strip()}.toml"))
    except NameRefusedError as error:
        raise SettingError(f"name of the mirror: {typed_words(error)}") from None
    for each in (path, path.with_suffix(".html")):
        if (folder / each).exists():
            raise SettingError(f"name of the mirror: {each} is there already and is left as it is; type another name")
    return path


def order(folder: Path, action: Action) -> Order:
    """The job of an identification.

    Args:
        folder: the working folder.
        action: the identification.
    """
    return Order("identification", action.title, (*action.arguments, "--json"), folder, action.results)
