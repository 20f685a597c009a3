"""HTML in which every text that is not `Markup` is escaped."""

from __future__ import annotations

from html import escape

from robovast.base.printable import printable

Content = str | None
"""A text, which is escaped unless it is `Markup`; None for nothing."""


class Markup(str):
    """HTML."""

    __slots__ = ()


def tag(name: str, *contents: Content, **attributes: str) -> Markup:
    """An element.

    Args:
        name: of the element.
        contents: texts and elements in it.
        attributes: without those that are empty; `class_` stands for `class`.
    """
    listed = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{text_of(value)}"'
        for key, value in attributes.items()
        if value
    )
    return Markup(f"<{name}{listed}>{joined(*contents)}</{name}>")


def joined(*contents: Content) -> Markup:
    """Texts and elements one after the other."""
    return Markup("".join(text_of(content) for content in contents if content))


def text_of(content: str) -> str:
    """HTML of a text; control characters become visible."""
    return content if isinstance(content, Markup) else escape(printable(content))
