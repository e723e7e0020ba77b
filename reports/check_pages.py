"""The page of the report that tells of each check: its question, formula and bound, and what a fail comes from."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

from hapticeval.phenomena.pages import read_page
from hapticeval.reports.places import CHECK_PAGES
from hapticeval.reports.templates import environment

if TYPE_CHECKING:
    from hapticeval.phenomena.check import Check

TITLE = re.compile(r"\A#[^\n]*\n")
"""The page's title, which the report sets itself."""

HEADING = re.compile(r"^## ", re.MULTILINE)
"""Headings of a page, which stand below the check's own here."""

CHECK_LINK = re.compile(r"\]\(([\w-]+)\.md\)")
OTHER_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\.md[^)]*\)")
"""Links to the page of a check, which is a place on this one, and to other pages of the documentation."""


def render_check_pages(checks: Iterable[Check], index: str) -> str:
    """Return the page for these checks, with a link to the first page of the report at `index`."""
    pages = [(check, html_of(read_page(check).text)) for check in checks]
    return environment().get_template("check_pages.html.j2").render(pages=pages, index=index)


def html_of(page: str) -> str:
    """Return a check's page in Markdown as HTML without its title; HTML in it is escaped."""
    from markdown_it import MarkdownIt

    # Title off, links to checks into anchors of this page, other links to their text, headings one level down.
    body = HEADING.sub("### ", OTHER_LINK.sub(r"\1", CHECK_LINK.sub(r"](#\1)", TITLE.sub("", page))))
    return str(MarkdownIt("commonmark", {"html": False}).render(body))


def link_to(check: str) -> str:
    """Return the link from the first page to what is told of a check."""
    return f"{CHECK_PAGES}#{check}"
