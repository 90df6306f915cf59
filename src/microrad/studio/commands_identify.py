"""An identification as a command to copy and as lines of Python to copy."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from microrad.studio.commands_pieces import as_path, joined, named, option, path_argument, path_texts


@dataclass(frozen=True, slots=True)
class Identify:
    """A mirror from recordings, into a mirror file and its report; columns are names or numbers counted from 0.

    `model` is one of `microrad.lab.identify.MODELS`, or None for the best one; `static` fits the hysteresis alone.
    """

    files: tuple[Path, ...]
    input: str
    output: str
    mirror_file: Path
    input_unit: str = "V"
    output_unit: str = "mrad"
    rate_hz: float | None = None
    time: str | None = None
    period_samples: int | None = None
    accept: tuple[str, ...] = ()
    validate: tuple[Path, ...] = ()
    lever_arm_m: float | None = None
    hold_out: float | None = None
    static: bool = False
    model: str | None = None
    admissible: bool = False
    seed: int = 0
    name: str | None = None
    overwrite: bool = False

    @property
    def arguments(self) -> tuple[str, ...]:
        """What follows `microrad` on the command line."""
        given: tuple[tuple[str, object], ...] = (
            ("--input", self.input),
            ("--output", self.output),
            ("--rate", self.rate_hz),
            ("--time", self.time),
            ("--period", self.period_samples),
            *(("--accept", finding) for finding in self.accept),
            *(("--validate", file) for file in self.validate),
            ("--input-unit", self.input_unit),
            ("--output-unit", self.output_unit),
            ("--lever-arm", None if self.lever_arm_m is None else f"{self.lever_arm_m!r} m"),
            ("--hold-out", self.hold_out),
            ("--model", None if self.model is None else self.model.replace("_", "-")),
            ("--seed", self.seed or None),
            ("--name", self.name),
            ("--mirror-file", self.mirror_file),
        )
        options = (part for name, value in given for part in option(name, value))
        switches = {"--static": self.static, "--admissible": self.admissible, "--overwrite": self.overwrite}
        files = (path_argument(file) for file in self.files)
        return ("identify", *files, *options, *(name for name, on in switches.items() if on))

    @property
    def python(self) -> str:
        """Lines of Python that do the same."""
        title = self.files[0].stem[:200] if self.name is None else self.name
        validation = f"[read(file) for file in {path_texts(self.validate)}]" if self.validate else "[]"
        return joined(
            "from pathlib import Path",
            "",
            "from microrad import read_recording, report",
            "from microrad.lab import identify, recording",
            "",
            f"target, page = {as_path(self.mirror_file)}, {as_path(self._page)}",
            *([] if self.overwrite else ["if target.exists():", "    raise FileExistsError(target)"]),
            "",
            "",
            "def read(file):",
            f"    found = read_recording(file, {', '.join(self._reading())})",
            f"    return recording.read_in(found, {self.input_unit!r}, {self.output_unit!r})",
            "",
            "",
            f"recordings = [read(file) for file in {path_texts(self.files)}]",
            "found = identify.identify(",
            "    recordings,",
            *(f"    {each}," for each in self._settings(validation)),
            ")",
            "if found.unsupported:",
            "    raise SystemExit(found.unsupported)",
            f"written = {self._written()}",
            f"text = identify.mirror_file_text(found, {title!r}, model=written)",
            "report.write_identification(",
            "    found,",
            "    page,",
            "    mirror_file=target,",
            "    mirror_text=text,",
            f"    title={title!r},",
            "    written=written,",
            "    recordings=recordings,",
            f"    overwrite={self.overwrite},",
            ")",
            'target.write_text(text, encoding="utf-8")',
            "print(report.identification_text(found, written, mirror_file=target, report_file=page))",
        )

    @property
    def results(self) -> tuple[str, ...]:
        """The mirror file and its report."""
        return (str(self.mirror_file), str(self._page))

    @property
    def _page(self) -> Path:
        return self.mirror_file.with_suffix(".html")

    def _reading(self) -> Iterable[str]:
        """Arguments that a recording is read with."""
        yield from (repr(self.input), repr(self.output), repr(self.rate_hz))
        yield from named(time=self.time, period_samples=self.period_samples, accept=self.accept or None)

    def _settings(self, validation: str) -> Iterable[str]:
        """Arguments that the models are fitted with."""
        models = "identify.STATIC[:2]" if self.static else "identify.MODELS"
        if self.model is not None:
            models = f"tuple(dict.fromkeys([*{models}, {self._model!r}]))"
        yield from (f"seed={self.seed}", f"models={models}", f"validation={validation}")
        yield from named(hold_out=self.hold_out, lever_arm_m=self.lever_arm_m, admissible=self.admissible or None)
        yield from named(input_unit=self.input_unit, output_unit=self.output_unit)

    @property
    def _model(self) -> str | None:
        return None if self.model is None else self.model.replace("-", "_")

    def _written(self) -> str:
        if self._model is None:
            return "found.chosen"
        return repr("bouc_wen_admissible" if self.admissible and self._model == "bouc_wen" else self._model)
