"""What tests of the studio's pages look at, as the server builds them without a browser."""

import asyncio

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


_OF_NICEGUI = "nicegui-expansion nicegui-row row nicegui-column nicegui-card q-card nicegui-link w-full js-plotly-plot"
_OWN = """role aria-label aria-current title src alt href multiple label hint dense outlined flat round outline no-caps
align icon debounce clearable spellcheck use-chips options-dense tabindex open for id row-key wrap-cells hide-bottom
instant-feedback disable error target type"""
_USUAL = {"target": "_self", "type": "text", "role": "figure"}


def outline(place, depth=0, seen=False):
    """What stands within a place, all of it or what is seen: a line each with tag, classes, properties, text, value."""
    found = []
    for each in (each for each in place.default_slot.children if each.visible or not seen):
        classes = "".join(f".{name}" for name in each.classes if name not in _OF_NICEGUI.split())
        own = {key: each.props[key] for key in _OWN.split() if key in each.props}
        told = {key: value for key, value in own.items() if value not in (None, False, _USUAL.get(key))}
        if isinstance(each, ui.button):
            told.pop("label", None)
        told = {k: v for k, v in told.items() if k not in ("for", "target") or not str(v).startswith(("c", "#c"))}
        props = "|".join(key if value is True else f"{key}={value}" for key, value in told.items())
        style, said = ";".join(f"{key}: {value}" for key, value in each.style.items()), getattr(each, "text", "")
        value, options = getattr(each, "value", None), getattr(each, "options", ())
        line = f"{each.tag.removeprefix('nicegui-')}{classes}{f'[{props}]' * bool(props)}{f'<{style}>' * bool(style)}"
        line += f" {said}" * bool(said) + f" = {value}" * (value not in (None, "", [], 0.0) or value is False)
        line += f" of {', '.join(options.values() if isinstance(options, dict) else options)}" * bool(options)
        line = f"timer {each.interval:g}" if isinstance(each, ui.timer) else line
        inside = [] if "studio-copy" in each.classes else outline(each, depth + 1, seen)
        if isinstance(each, ui.table):
            line += f" of {', '.join(_column(column) for column in each.columns)}"
            names = [column["name"] for column in each.columns]
            inside = [f"{'  ' * depth}| {' | '.join(map(str, _cells(row, names)))}" for row in each.rows]
        found += ["  " * depth + line.replace("\n", " / "), *inside]
    return found


def _column(column):
    """A column's heading, behind ">" where it holds numbers."""
    return f"{'>' * (column['align'] == 'right')}{column['label']}"


def _cells(row, names):
    """The cells of a row, with their marks; a sum begins with "=="."""
    marks = [f"{row[name]} {row.get(f'mark{name[1:]}', '')}".rstrip() for name in names]
    return ["==", *marks] if row["total"] else marks


def press(button):
    """What a click on a button does, to its end."""

    async def clicked():
        for each in list(button._event_listeners.values()):
            if each.type == "click":
                each.handler(None)
        for task in asyncio.all_tasks() - {asyncio.current_task()}:
            await task

    asyncio.run(clicked())
