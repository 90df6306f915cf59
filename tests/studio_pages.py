"""What tests of the studio's pages look at, as the server builds them without a browser."""

from nicegui import ui


def texts(place):
    """What the elements within a place say, those that say something."""
    return [each.text for each in place.descendants() if getattr(each, "text", "")]


def buttons(place):
    """The buttons within a place by what they say."""
    return {each.text: each for each in place.descendants() if isinstance(each, ui.button)}


async def here(page, work, *args, **kwargs):
    """In place of a thread."""
    return work(*args, **kwargs)
