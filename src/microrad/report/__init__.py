"""What was found, for a reader: pages that open offline, sentences, tables, figures, plain data and files.

A subject is a folder; `page`, `plotting` and `results` are shared.
"""

import csv
import io
import pickle
from collections.abc import Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from microrad.core.folder import MANIFEST, FolderError, check_folder, whole_folder
from microrad.core.kept import NOTHING, Kept
from microrad.core.progress import Progress
from microrad.core.threads import beside
from microrad.report.tables import Column, numbers_text, rows_of

if TYPE_CHECKING:
    from microrad.orbit.constellation import ConstellationPlan
    from microrad.report.identification.coupled import coupled_identification_text, write_coupled_identification
    from microrad.report.identification.coupled_data import coupled_identification_data
    from microrad.report.identification.data import identification_data
    from microrad.report.identification.page import (
        ReportError,
        check_identification,
        identification_text,
        write_identification,
    )
    from microrad.report.plotting.figure import Figure
    from microrad.report.study.data import summary
    from microrad.report.study.page import StudyFigures
    from microrad.report.study.words import verdict_text
    from microrad.study.study import Study

_LAZY = {
    "ReportError": "identification.page",
    "check_identification": "identification.page",
    "coupled_identification_data": "identification.coupled_data",
    "coupled_identification_text": "identification.coupled",
    "write_coupled_identification": "identification.coupled",
    "write_identification": "identification.page",
    "identification_data": "identification.data",
    "identification_text": "identification.page",
    "summary": "study.data",
    "verdict_text": "study.words",
}

__all__ = [
    "FolderError",
    "ReportError",
    "check_folder",
    "check_identification",
    "coupled_identification_data",
    "coupled_identification_text",
    "identification_data",
    "identification_text",
    "study_figures",
    "summary",
    "verdict_text",
    "write",
    "write_coupled_identification",
    "write_identification",
]


def __getattr__(name: str) -> Any:
    """A name of `_LAZY`: study and identification load when they are asked for, not with the words of a campaign."""
    if name in _LAZY:
        return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def write(
    study: "Study",
    folder: str | Path,
    *,
    overwrite: bool = False,
    on_progress: Progress = lambda done, total, what: None,
    parts: Kept = NOTHING,
) -> Path:
    """Write report.html, results.nc, manifest.json and figures/ into a folder, all of them or none.

    Args:
        study: a run of a whole mission.
        folder: where to; it is made.
        overwrite: whether results of microrad that are there may be replaced.
        on_progress: is told how far it is.
        parts: those of earlier runs that are kept: none by default.

    Raises FolderError if the folder holds something that must not be replaced. Returns the page's path.

    Example:
        ```python
        import microrad

        study = microrad.run_study(microrad.load_mission("leo-geo.toml"))
        print(microrad.write_report(study, "leo-geo-study"))
        ```
    """
    from microrad.report.results.arrays import study_netcdf
    from microrad.report.results.manifest import manifest_of, write_manifest
    from microrad.report.study.data import summary
    from microrad.report.study.page import study_page

    folder = Path(folder)
    numbers_of = partial(parts.part, study_netcdf, study)
    with whole_folder(folder, overwrite) as draft, beside(numbers_of) as numbers:
        on_progress(0, 3, "figures")
        drawn = study_figures(study, parts)
        (draft / "figures").mkdir()
        made = parts.part(pictures, pickle.dumps(drawn.every, protocol=5))
        for figure, (svg, plot, data) in zip(drawn.every, made, strict=True):
            figure.take(svg, plot)
            (draft / "figures" / f"{figure.name}.svg").write_text(svg, encoding="utf-8")
            (draft / "figures" / f"{figure.name}.csv").write_bytes(data)
        on_progress(1, 3, "page")
        manifest = manifest_of(study, summary(study), draft)
        (draft / "report.html").write_text(study_page(study, drawn, manifest), encoding="utf-8")
        on_progress(2, 3, "results")
        if study.plan is not None:
            write_plan(study.plan, draft)
        (draft / "results.nc").write_bytes(numbers())
        write_manifest(manifest, draft, MANIFEST)
        on_progress(3, 3, "done")
    return folder / "report.html"


def study_figures(study: "Study", parts: Kept = NOTHING) -> "StudyFigures":
    """The figures of a study's page, by its parts.

    Args:
        study: a run of a whole mission.
        parts: those of earlier runs that are kept: none by default.
    """
    from microrad.report.day.figures import day_figures
    from microrad.report.error_budget.figures import budget_figures
    from microrad.report.fine_pointing.figures import fine_pointing_figures
    from microrad.report.fine_pointing.tails import tail_figures
    from microrad.report.links.figures import link_figures
    from microrad.report.paper.bench import bench_figures
    from microrad.report.paper.figures import paper_figures
    from microrad.report.study.page import StudyFigures

    return StudyFigures(
        paper_figures(study),
        bench_figures(study, parts),
        fine_pointing_figures(study, parts),
        tail_figures(study),
        link_figures(study.links),
        () if study.error_budget is None else budget_figures(study.error_budget),
        () if study.day is None else day_figures(study.day, study.contact),
    )


def write_plan(plan: "ConstellationPlan", folder: Path) -> None:
    """The sessions of a constellation for a spreadsheet, and as a contact plan.

    Args:
        plan: who is served when.
        folder: where to; files of the same names are replaced.
    """
    from microrad.orbit.operations import csv_text

    (folder / "sessions.csv").write_text(csv_text(plan.planned, plan.epoch.utc) + "\n", encoding="utf-8")
    (folder / "contact-plan.ionrc").write_text(plan.contact_plan() + "\n", encoding="utf-8")


def pictures(figures: bytes) -> tuple[tuple[str, str, bytes], ...]:
    """Of each figure the static picture, what the page's script draws it from, and its data as CSV.

    The figures are pickled: a picture shows all of its figure, and one digest of all is quicker than one of each array.
    """
    drawn: Sequence[Figure] = pickle.loads(figures)
    return tuple((figure.svg, figure.plot, columns_csv(figure.columns)) for figure in drawn)


def columns_csv(columns: Mapping[str, Column]) -> bytes:
    """Columns as CSV with a heading, numbers to nine digits; shorter columns end early."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(columns)
    numbers = [column for column in columns.values() if not isinstance(column, tuple)]
    if len(numbers) == len(columns) > 1:
        text.write(numbers_text(numbers, 9, ",", "\r\n"))
    else:
        writer.writerows(rows_of(columns, 9))
    return text.getvalue().encode()
