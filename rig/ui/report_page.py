"""HTML elements and the page around them; the one place that turns text into markup."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from urllib.parse import quote

from rig.ui.report_style import STYLE
from rig.ui.text import escaped

VOID = frozenset(("img", "meta"))  # elements without content


class Html(NamedTuple):
    """Markup. Made by the functions of this module, or by `trusted` from text of our own."""

    markup: str


def element(tag: str, *content: object, **attributes: object) -> Html:
    """Create an element; content that is not Html, and every attribute, is escaped.

    A trailing `_` of an attribute is dropped: class_. `_` inside stands for `-`: aria_label.
    """
    words = [tag]
    for name, value in attributes.items():
        key = name.rstrip("_").replace("_", "-")
        words.append(f'{key}="{escaped(value)}"')
    start = f"<{' '.join(words)}>"
    if tag in VOID:
        return Html(start)
    return Html(f"{start}{join(*content).markup}</{tag}>")


def join(*content: object) -> Html:
    """Put contents one after the other; what is not Html is escaped."""
    parts = [one.markup if isinstance(one, Html) else escaped(one) for one in content]
    return Html("".join(parts))


def trusted(markup: str) -> Html:
    """Take text of our own as markup; never text that comes from a file."""
    return Html(markup)


def table(heads: Sequence[str], rows: Sequence[Sequence[object]], class_: str = "numbers") -> Html:
    """Create a table in a box that scrolls where the table is wider than the page.

    The first cell of a row is its heading. Without heads the table has no heading row.
    """
    lines = []
    if heads:
        lines.append(element("tr", *[element("th", head, scope="col") for head in heads]))
    for first, *others in rows:
        cells = [element("td", cell) for cell in others]
        lines.append(element("tr", element("th", first, scope="row"), *cells))
    return element("div", element("table", *lines, class_=class_), class_="scroll")


def link(name: str) -> Html:
    """Link to a file beside the page, shown by its name."""
    return element("a", name, href=f"./{quote(name)}")


def page(title: str, *content: object) -> str:
    """Create the whole document, with its style inside and nothing outside."""
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("style", trusted(STYLE)),
    )
    body = element("body", element("main", *content))
    document = element("html", head, body, lang="en")
    return f"<!doctype html>\n{document.markup}\n"
