"""MkDocs hooks for the gallery: an entry for every demo and every playable scene, and a page for each script.

The first paragraph of a demo's docstring describes what the film shows, the second paragraph what to notice.
The docstrings in `play/scenes.py` describe the scenes. On the page, the scenes are above the demos. Stills
come from the folder `docs/pictures` in the repository. Films and worlds come from `docs/gallery`, where
`make_gallery.py` and `make_worlds.py` write them. If they are missing, an entry shows its still, and the page
says how to make them. MkDocs calls these functions by their names (mkdocs.yml, `hooks`).
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "gallery"
WORLDS = FOLDER / "play"

ENTRY = """<section class="demo" markdown>

### {name}

{film}

{what}

**What to notice:** {notice}

[Script](demos/{name}.md) &middot; `taichi-soft demo {name}`

</section>"""

FILM = """<video class="film" controls loop muted playsinline preload="none" width="480" height="270" \
poster="pictures/demos/{name}.jpg" aria-label="Film: {alt}">
<source src="gallery/{name}.webm" type="video/webm">
{still}
</video>"""

STILL = """<img class="film" src="pictures/demos/{name}.jpg" alt="{alt}" width="480" height="270" \
loading="lazy">"""

PAUSE = '<p><button id="films" class="md-button" type="button" hidden>Pause all films</button></p>'

PLAYED = """<section class="demo" markdown>

### {title}

{still}

{what}

</section>"""

PLAYED_STILL = """<img class="film" src="pictures/play/{name}.jpg" alt="{title}" width="480" height="270" \
loading="lazy">"""

LINK = """<a href="gallery/play/index.html#{name}" aria-label="Play: {title}">{still}</a>"""

WORLDLESS = """!!! note "Stills instead of worlds"

    This copy of the documentation was built without its worlds. `make gallery` makes them, which takes \
minutes. Then `make docs` adds them to the site."""

MISSING = """!!! note "Stills instead of films"

    This copy of the documentation was built without {what}. `make gallery` films every demo, which \
takes minutes. Then `make docs` adds the films to the site."""

SCRIPT = """---
search:
  exclude: true
---
# demos/{name}.py

{what} See it in [the gallery](../gallery.md#{name}), or make the film: \
`taichi-soft demo {name} --out {name}.webm`.

```python
{script}
```
"""


@dataclass(frozen=True)
class Played:
    """Text of the gallery about a playable scene."""

    name: str
    title: str
    what: str  # what a visitor can do


def scenes() -> list[Played]:
    """Return all playable scenes, from the public functions of `play/scenes.py`."""
    script = ast.parse((ROOT / "docs" / "play" / "scenes.py").read_text(encoding="utf-8"))
    found = []
    for each in script.body:
        if isinstance(each, ast.FunctionDef) and not each.name.startswith("_"):
            title, _, what = (ast.get_docstring(each) or "").partition("\n\n")
            found.append(Played(each.name, title.rstrip("."), " ".join(what.split())))
    return found


@dataclass(frozen=True)
class Demo:
    """Script of a demo, and text of the gallery about it."""

    name: str
    script: str
    what: str  # what the film shows
    notice: str

    @classmethod
    def of(cls, file: Path) -> Demo:
        """Read a demo from its file. Raises: ValueError if its docstring has no second paragraph."""
        script = file.read_text(encoding="utf-8")
        what, _, notice = (ast.get_docstring(ast.parse(script)) or "").partition("\n\n")
        if not notice:
            raise ValueError(f"the docstring of {file.name} needs a second paragraph: what to notice")
        return cls(file.stem, script, " ".join(what.split()), " ".join(notice.split()))


def demos() -> list[Demo]:
    """Return all demos that define a function `stage`."""
    files = sorted((ROOT / "demos").glob("[a-z]*.py"))
    return [Demo.of(file) for file in files if "\ndef stage(" in file.read_text(encoding="utf-8")]


def on_files(files: Any, config: Any) -> Any:
    """Add a page for the script of each demo."""
    from mkdocs.structure.files import File  # local: the rest of this file works without MkDocs

    for demo in demos():
        text = SCRIPT.format(name=demo.name, what=demo.what, script=demo.script.strip())
        files.append(File.generated(config, f"demos/{demo.name}.md", content=text))
    return files


def on_page_markdown(text: str, page: Any, **_: Any) -> str:
    """Insert the entries into the page of the gallery."""
    if page.file.src_uri != "gallery.md":
        return text
    return text.replace("<!-- play -->", played()).replace("<!-- demos -->", entries())


def played() -> str:
    """Return the entries of all playable scenes. An entry links to its scene if the scene has been made."""
    found, missing = [], False
    for scene in scenes():
        named = {"name": scene.name, "title": escape(scene.title, quote=True)}
        still = PLAYED_STILL.format(**named)
        if (WORLDS / scene.name / "scene.json").is_file():
            still = LINK.format(still=still, **named)
        else:
            missing = True
        found.append(PLAYED.format(title=scene.title, what=scene.what, still=still))
    head = [WORLDLESS] if missing else []
    return "\n\n".join([*head, '<div class="gallery" markdown>', *found, "</div>"])


def entries() -> str:
    """Return the entries of all demos, and the grid that contains them."""
    shown = [_entry(demo) for demo in demos()]
    filmed = sum("<video" in each for each in shown)
    head = [PAUSE] if filmed else []
    if filmed < len(shown):
        head.append(MISSING.format(what="some of its films" if filmed else "its films"))
    grid = ['<div class="gallery" markdown>', *shown, "</div>"]
    return "\n\n".join([*head, *grid, '<script src="theme/gallery.js" defer></script>'])


def _entry(demo: Demo) -> str:
    """Return the entry of a demo, with its film, or with its still if there is no film."""
    named = {"name": demo.name, "alt": escape(demo.what, quote=True)}
    film = STILL.format(**named)
    if (FOLDER / f"{demo.name}.webm").is_file():
        film = FILM.format(still=film, **named)
    return ENTRY.format(name=demo.name, film=film, what=demo.what, notice=demo.notice)
