"""The gallery of the documentation site: an entry for every demo, and a page with its script.

An entry is made of the docstring of the demo: its first paragraph says what is seen, its second one what to
notice. Its still comes from `docs/pictures/demos`, which is in the repository. Films and the page with bodies
to turn come from `docs/gallery`, where `make_gallery.py` puts them. Without its film an entry shows its
still, and the page says how to make the films. MkDocs calls these functions by their names (mkdocs.yml,
`hooks`).
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "gallery"

ENTRY = """<section class="demo" markdown>

### {name}

{film}

{what}

**What to notice:** {notice}

[Script](demos/{name}.md){turn} &middot; `taichi-soft demo {name}`

</section>"""

FILM = """<video class="film" controls loop muted playsinline preload="none" width="480" height="270" \
poster="pictures/demos/{name}.jpg" aria-label="Film: {alt}">
<source src="gallery/{name}.webm" type="video/webm">
{still}
</video>"""

STILL = """<img class="film" src="pictures/demos/{name}.jpg" alt="{alt}" width="480" height="270" \
loading="lazy">"""

PAUSE = '<p><button id="films" class="md-button" type="button" hidden>Pause all films</button></p>'

VIEWER = """## Turn it, and stop the time

{count} demos as data: the places of all vertices in each picture, in some hundred kilobytes.

<iframe class="viewer" src="gallery/viewer.html" title="Bodies to turn, and time to scrub" \
loading="lazy"></iframe>

[Open it by itself](gallery/viewer.html){{ target="_blank" }}. It is one file of {size:.1f} MB: save it, \
and it opens from a folder too, without a server. The picture turns by dragging and by arrow keys."""

MISSING = """!!! note "Stills instead of films"

    This copy of the documentation was built without {what}. `make gallery` films every demo, in some \
minutes; then `make docs` takes the films into the site."""

SCRIPT = """---
search:
  exclude: true
---
# demos/{name}.py

{what} See it in [the gallery](../gallery.md#{name}), or make the film yourself: \
`taichi-soft demo {name} --out {name}.webm`.

```python
{script}
```
"""


@dataclass(frozen=True)
class Demo:
    """What the page says of a demo."""

    name: str
    script: str
    what: str  # is seen
    notice: str

    @classmethod
    def of(cls, file: Path) -> Demo:
        """The demo that a file sets. Raises: ValueError where its docstring has no second paragraph."""
        script = file.read_text(encoding="utf-8")
        what, _, notice = (ast.get_docstring(ast.parse(script)) or "").partition("\n\n")
        if not notice:
            raise ValueError(f"the docstring of {file.name} needs a second paragraph: what to notice")
        return cls(file.stem, script, " ".join(what.split()), " ".join(notice.split()))


def demos() -> list[Demo]:
    """All demos that set a stage."""
    files = sorted((ROOT / "demos").glob("[a-z]*.py"))
    return [Demo.of(file) for file in files if "\ndef stage(" in file.read_text(encoding="utf-8")]


def on_files(files: Any, config: Any) -> Any:
    """Add a page for the script of each demo."""
    from mkdocs.structure.files import File  # here: what else is in this file works without MkDocs

    for demo in demos():
        text = SCRIPT.format(name=demo.name, what=demo.what, script=demo.script.strip())
        files.append(File.generated(config, f"demos/{demo.name}.md", content=text))
    return files


def on_page_markdown(text: str, page: Any, **_: Any) -> str:
    """Fill the gallery."""
    if page.file.src_uri != "gallery.md":
        return text
    return text.replace("<!-- viewer -->", viewer()).replace("<!-- demos -->", entries())


def viewer() -> str:
    """The page with bodies to turn, within this one; nothing where it was not made."""
    file = FOLDER / "viewer.html"
    if not file.is_file():
        return ""
    return VIEWER.format(count=len(list(FOLDER.glob("*.motion"))), size=file.stat().st_size / 1e6)


def entries() -> str:
    """One for each demo, and what holds them."""
    shown = [_entry(demo) for demo in demos()]
    filmed = sum("<video" in each for each in shown)
    head = [PAUSE] if filmed else []
    if filmed < len(shown):
        head.append(MISSING.format(what="some of its films" if filmed else "its films"))
    grid = ['<div class="gallery" markdown>', *shown, "</div>"]
    return "\n\n".join([*head, *grid, '<script src="theme/gallery.js" defer></script>'])


def _entry(demo: Demo) -> str:
    """Return what the page shows of a demo: its film, or else its still."""
    named = {"name": demo.name, "alt": escape(demo.what, quote=True)}
    film = STILL.format(**named)
    if (FOLDER / f"{demo.name}.webm").is_file():
        film = FILM.format(still=film, **named)
    is_turned = all((FOLDER / name).is_file() for name in (f"{demo.name}.motion", "viewer.html"))
    turn = f' &middot; [Turn it](gallery/viewer.html#{demo.name}){{ target="_blank" }}' if is_turned else ""
    return ENTRY.format(name=demo.name, film=film, what=demo.what, notice=demo.notice, turn=turn)
