"""The links as a page of their own."""

from microrad.link.requirement import met, of_links
from microrad.link.study import LinkStudy, Solution
from microrad.report.links import words
from microrad.report.links.figures import link_figures
from microrad.report.links.views import links_views
from microrad.report.page.templates import inputs_view, mission_page
from microrad.report.requirements import derived_words, requirement_table
from microrad.report.view import Verdict, told


def links_page(study: LinkStudy, solution: Solution | None = None) -> str:
    """The budgets as one page that loads nothing, with their figures and no drawing library: their numbers stand below.

    Args:
        study: the links, at their budgeted errors or under their jitter.
        solution: the values of a key that leave the required margin, if one was solved for.
    """
    judged = of_links(study)
    said = [] if solution is None else [words.solution_text(solution)]
    figures = [figure.static for figure in link_figures(study)]
    views = (*links_views(study, figures), inputs_view(study.file.sources))
    lead = Verdict(words.verdict(study), told(requirement_table(judged), derived_words(judged), *said), met(study))
    return mission_page(study.file, "budget", [lead], views, data="below")
