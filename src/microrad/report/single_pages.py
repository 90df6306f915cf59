"""The budgets and the day each as one page that loads nothing."""

from microrad.link.requirement import met, of_links
from microrad.link.study import LinkStudy, Solution
from microrad.orbit.day import DayStudy
from microrad.report import budget_views, day_plots, day_views, link_figures, links, page, requirements, scripts
from microrad.report.quantities import quantity


def budget(study: LinkStudy, solution: Solution | None = None) -> str:
    """The budgets as one page that loads nothing, with their figures, and what was solved for.

    They are bars and a few curves, with their numbers in tables below them: no reason to carry a drawing library eight
    times as long as the page.
    """
    figures = [figure.static for figure in link_figures.draw(study)]
    budgets = [(budget, "") for budget in study.budgets]
    context = {
        "study": study,
        "mission": study.file.mission,
        "verdict": budget_views.verdict(study),
        "met": met(study),
        "solved": "" if solution is None else budget_views.solution_text(solution),
        "paragraph": requirements.paragraph(of_links(study)),
        "links": links.context(study, budgets=budgets, figures=figures, files=False),
        "quantity": quantity,
        "angle": page.angle,
        "inputs": list(study.file.sources.items()),
    }
    return scripts.with_scripts(page.pages().get_template("budget.html").render(context))


def day(of: DayStudy, links: LinkStudy) -> str:
    """The day as one page that loads nothing, with its figures."""
    figures = day_plots.draw(of)
    text = (
        page.pages()
        .get_template("day_page.html")
        .render(
            study=links,
            mission=links.file.mission,
            day=day_views.context(of, figures, files=False),
            inputs=list(links.file.sources.items()),
        )
    )
    return scripts.with_scripts(text)
