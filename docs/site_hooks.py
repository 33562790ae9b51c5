"""MkDocs hooks: set the address and version of the site; add the report, and files from above this folder.

MkDocs calls these functions by their names (mkdocs.yml, `hooks`).
"""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import markdown
from mkdocs.structure.files import File, Files

from taichi_soft.core.version import VERSION

ROOT = Path(__file__).parents[1]
REPORT = ROOT / "docs" / "report"
ABOVE = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Files at the top of the repository, and the pages that they become."""

PAGE = """<!DOCTYPE html>
<html lang="en-GB">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>taichi-soft: the thesis's experiments, measured</title>
<style>
{style}
main > table {{ display: block; overflow-x: auto; width: fit-content; max-width: 100%; }}
main > table {{ background: var(--card); }}
main > table th, main > table td {{ padding: 5px 10px; vertical-align: top; min-width: 4.5rem; }}
main > table td {{ border-top: 1px solid var(--line); }}
main > h2 {{ margin-top: 1.6em; }}
main img {{ max-width: 100%; height: auto; background: #fff; }}
</style>
</head>
<body>
<main>
<p class="source"><a href="index.html">Back to the documentation</a></p>
{body}
</main>
</body>
</html>
"""


def on_config(config: Any) -> Any:
    """Set the address of the repository, from pyproject.toml, and the version of the library."""
    address = re.search(r'^Homepage = "(.*)"$', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.M)
    assert address is not None
    config.repo_url, config.repo_name = address[1], config.site_name
    config.extra["version_text"] = VERSION
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages for files in `ABOVE`, and the report as a self-contained page."""
    for name, page in ABOVE.items():
        files.append(File.generated(config, page, abs_src_path=str(ROOT / name)))
    files.append(File.generated(config, "report/full.html", content=_report()))
    return files


def on_page_markdown(text: str, page: Any, **_: Any) -> str:
    """Redirect links between files of the repository to their pages, and fill in the page of the report."""
    name = page.file.src_uri
    if name == "report/index.md":
        return text.replace("<!-- head -->", _head()).replace("<!-- verdicts -->", _verdicts())
    for above, its_page in ABOVE.items():
        text = text.replace(f"](../{above})", f"]({its_page})").replace(f"]({above})", f"]({its_page})")
    return text.replace("](docs/", "](") if name in ABOVE.values() else text


def _head() -> str:
    """Return sentences on when and how the report was made, and on how many claims hold."""
    text = (REPORT / "report.md").read_text(encoding="utf-8")
    facts = dict(re.findall(r"^- (\w+): (.*)$", text, re.MULTILINE))
    counts = re.findall(r"^Of \d+ (?:claims of the thesis|statements of theory): .*$", text, re.MULTILINE)
    assert len(counts) == 2
    return (
        f"It was made on {facts['Made']} by `{facts['Command']}`, on {facts['processor']}. {' '.join(counts)}"
    )


def _verdicts() -> str:
    """Return all claims with their verdicts in Markdown, one table for each chapter."""
    lines, chapter = [], ""
    with (REPORT / "verdicts.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["chapter"] != chapter:
                chapter = row["chapter"]
                lines += ["", f"### {chapter}", "", "| verdict | claim | measured |", "|---|---|---|"]
            anchor = f"experiment-{row['experiment']}"
            claim = f"{row['text']} ({row['source']}; [experiment](full.html#{anchor}))"
            measured = row["measured"] + (f". **Why:** {row['why']}" if row["why"] else "")
            cells = (f"**{row['verdict']}**", claim, measured)
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def _report() -> str:
    """Return `report.md` as an HTML page in the style of the pages from `python -m lab report`."""
    text = (REPORT / "report.md").read_text(encoding="utf-8")
    text = re.sub(r"^  - ", "    - ", text, flags=re.MULTILINE)  # nested lists need four spaces
    body = markdown.markdown(text, extensions=["tables", "sane_lists"])
    style = (ROOT / "lab/report/templates/report.css").read_text(encoding="utf-8")
    return PAGE.format(style=style, body=body)
