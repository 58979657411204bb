"""Check that all links of the built site have targets, and no page needs a network.

``python docs/site/links.py FOLDER``; the exit code is 1 if not.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

NEEDED = {('script', 'src'), ('img', 'src'), ('link', 'href'), ('iframe', 'src')}


class Link(NamedTuple):
    """Reference of a page, and whether the page needs it."""

    address: str
    needed: bool


class Page(HTMLParser):
    """Links of a page, and the targets in it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[Link] = []
        self.anchors = {''}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect the reference and the name of a tag."""
        for key, value in attrs:
            if value is None:
                continue
            if key == 'id' or (tag == 'a' and key == 'name'):
                self.anchors.add(value)
            elif key in ('href', 'src'):
                self.links.append(Link(value, (tag, key) in NEEDED))


def wrong(folder: Path) -> list[str]:
    """Sentences on links without a target, or forbidden ones out of the site."""
    pages = {
        file.resolve(): Page(file.read_text(encoding='utf-8')) for file in folder.rglob('*.html')
    }
    said = []
    for file, page in pages.items():
        for link in page.links:
            to = urlsplit(link.address)
            if to.scheme or to.netloc:
                if link.needed and to.scheme != 'data':
                    said.append(f'{file}: needs the network: {link.address}')
                continue
            target = (file.parent / unquote(to.path)).resolve() if to.path else file
            if not target.is_file():
                said.append(f'{file}: there is no {link.address}')
            elif target in pages and unquote(to.fragment) not in pages[target].anchors:
                said.append(f'{file}: there is no #{to.fragment} in {link.address}')
    return said


if __name__ == '__main__':
    found = wrong(Path(sys.argv[1]))
    print(*found, sep='\n', end='\n' if found else '')
    sys.exit(bool(found))
