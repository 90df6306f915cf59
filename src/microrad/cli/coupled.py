"""A mirror of several channels from recordings: what `microrad identify` does where there is more than one."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from microrad.cli.frame import INTERRUPTED, Outcome, Refusal, json_text, progress_bar, say, width
from microrad.cli.recordings import Given
from microrad.core.folder import write_whole


@dataclass(frozen=True, slots=True)
class Target:
    """The files to write, and what is said of them; `check` refuses a mirror file that must not be replaced."""

    mirror_file: Path
    page: Path
    title: str
    overwrite: bool
    check: Callable[[], None]


def refuse_options(given: Given, options: dict[str, bool]) -> None:
    """Refuse options that mean nothing for these recordings.

    Args:
        given: The recordings, of several channels.
        options: Whether each option is given, by its name.

    Raises:
        Refusal: For the first that is.
    """
    inputs, outputs = given.channels
    for flag, is_given in options.items():
        if is_given:
            raise Refusal(
                f"{flag} is for one drive and one output, and these recordings have {inputs} and {outputs}: leave it "
                "out, or name one of each (--input, --output)."
            )


def identify_channels(given: Given, units: tuple[str, str], said: str, target: Target, as_json: bool) -> Outcome:
    """Identify a mirror of several channels, and write its file and report; what was found so far, where it is stopped.

    Args:
        given: The recordings.
        units: Units of drives and outputs.
        said: Words for the units, which begin the text.
        target: The files to write.
        as_json: Whether the text is to be JSON.
    """
    from microrad import report
    from microrad.lab.identify import coupled
    from microrad.lab.identify.coupled.mirror_file import coupled_file_text

    with progress_bar() as bar:
        found = coupled.identify_coupled(
            given.recordings,
            validation=given.validation,
            drive_unit=units[0],
            output_unit=units[1],
            positions_m=given.positions_m,
            signs=given.signs,
            on_progress=bar,
        )
    text = coupled_file_text(found, given.every, target.title)
    files = {"mirror_file": target.mirror_file, "report_file": target.page}
    printed = (
        json_text(report.coupled_identification_data(found, **files))
        if as_json
        else f"{said}\n\n{report.coupled_identification_text(found, width(), **files)}"
    )
    target.check()  # the file may have appeared meanwhile
    report.write_coupled_identification(
        found,
        target.page,
        mirror_file=target.mirror_file,
        mirror_text=text,
        title=target.title,
        overwrite=target.overwrite,
        virtual=given.virtual,
    )
    write_whole(target.mirror_file, text)
    if found.stopped:
        say("stopped; the best model so far was written")
    return Outcome(printed, INTERRUPTED if found.stopped else 0)
