"""A report's page but for our own scripts, to look at everything else in it."""

import re

from microrad.report import interactive


def without_scripts(page):
    """The page without the data of its figures, none of which holds a tag, and without the drawing library."""
    data = re.escape(interactive.MARK) + "[^<]*</script>\n?"
    return re.sub(data, "", page.replace(interactive.library(), ""))
