"""Results as small tables of HTML, which notebooks show."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

__all__ = ["html_table"]


def html_table(title: str, rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table with a title.

    Parameters
    ----------
    title : str
        What it is about.
    rows : iterable of tuple of str
        Cells; the first of each row is its heading.

    Returns
    -------
    str
        HTML; all text is escaped.
    """
    body = "".join(
        f"<tr><th>{escape(head)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
        for head, *cells in rows
    )
    return f"<table><caption>{escape(title)}</caption>{body}</table>"
