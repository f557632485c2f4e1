"""Parses an HTML report for its structure."""

from __future__ import annotations

from base64 import b64decode
from html.parser import HTMLParser


class Outline(HTMLParser):
    """Counts a page's figures and captions, and lists what a browser would load from elsewhere and the images in it.

    Attributes:
        fetched: addresses and tags that make a browser load something.
        open: tags that were opened and not yet closed.
        images: content of each embedded image.
        best: text of each table cell that is marked as the best of its column.
        figures: number of figures.
        captions: number of captions.
    """

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.open: list[str] = []
        self.images: list[bytes] = []
        self.best: list[str] = []
        self.figures = self.captions = 0
        self._in_best = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        links = [value for name, value in values.items() if name in ("src", "href", "srcset")]
        self.fetched += [link for link in links if not link.startswith(("data:", "#"))]
        self.images += [b64decode(link.partition(",")[2], validate=True) for link in links if link.startswith("data:")]
        self.fetched += [tag] if tag in ("script", "link", "iframe", "object") else []
        self.figures += tag == "figure"
        self.captions += tag == "figcaption"
        self._in_best = values.get("class") == "best"
        if tag not in ("img", "meta", "br"):
            self.open.append(tag)

    def handle_data(self, data: str) -> None:
        if self._in_best:
            self.best.append(data)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
        self._in_best = False
