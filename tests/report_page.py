"""What a page of the report says, without a browser."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from html.parser import HTMLParser
from typing import Any


@dataclass
class Shown:
    """A number on the page: its place in the JSON, its value, what a reader sees."""

    key: str
    value: float
    scale: float
    text: str = ""


@dataclass
class Content:
    numbers: list[Shown] = field(default_factory=list)
    headings: list[str] = field(default_factory=list)
    captions: list[str] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    canvases: list[str] = field(default_factory=list)
    tags: set[str] = field(default_factory=set)
    text: str = ""
    scripts: dict[str, str] = field(default_factory=dict)

    def json(self, name: str) -> Any:
        return json.loads(self.scripts[name])


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.content = Content()
        self._inside: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        named = dict(attributes)
        self.content.tags.add(tag)
        for name in ("href", "src"):
            if named.get(name):
                self.content.links.append(str(named[name]))
        if tag not in ("meta", "br", "img"):
            self._inside.append((tag, named))
        if tag == "data":
            self.content.numbers.append(
                Shown(
                    str(named["data-key"]),
                    float(str(named["value"])),
                    float(named.get("data-scale") or 1.0),
                )
            )
        if tag in ("h1", "h2"):
            self.content.headings.append("")
        if tag == "figcaption":
            self.content.captions.append("")
        if named.get("class") == "canvas":
            self.content.canvases.append(str(named["id"]))

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.content.tags.add(tag)

    def handle_endtag(self, tag: str) -> None:
        while self._inside and self._inside.pop()[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        tags = [tag for tag, _ in self._inside]
        if tags and tags[-1] == "script":
            name = self._inside[-1][1].get("id")
            if name:
                self.content.scripts[name] = data
            return
        if "style" in tags:
            return
        self.content.text += data
        if "data" in tags:
            self.content.numbers[-1].text += data
        if {"h1", "h2"} & set(tags):
            self.content.headings[-1] += data
        if "figcaption" in tags:
            self.content.captions[-1] += data


def content_of(page: str) -> Content:
    reader = _Reader()
    reader.feed(page)
    reader.close()
    return reader.content
