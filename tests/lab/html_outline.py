"""What a report's page is made of."""

from __future__ import annotations

from html.parser import HTMLParser


class Outline(HTMLParser):
    """Whatever of a page a browser would fetch, and its figures' captions."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.open: list[str] = []
        self.figures = self.captions = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.fetched += [v for n, v in values.items() if n in ("src", "href", "srcset") and not v.startswith("data:")]
        self.fetched += [tag] if tag in ("script", "link", "iframe", "object") else []
        self.figures += tag == "figure"
        self.captions += tag == "figcaption"
        if tag not in ("img", "meta", "br", "path"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag != "path":
            assert self.open.pop() == tag
