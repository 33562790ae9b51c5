"""Files of the report: complete, equal to the numbers, and safe for any text. The contents are made up."""

import base64
import csv
import io
import json
import re
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import cv2
import invented_sections as invented
import numpy as np
import pytest

from lab.experiments import (
    CLAIMS,
    Effort,
    Finding,
    Picture,
    Plot,
    Results,
    Section,
    Table,
    Verdict,
)
from lab.report.markdown import escaped
from lab.report.page import write_report
from lab.report.plots import png_of
from lab.report.wording import duration, legible, readable
from taichi_soft import OptionError

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

VOID = {"meta", "img", "br", "hr", "link", "input"}


class Tree(HTMLParser):
    """Elements of a page as [tag, attributes, words directly inside, parent], and whether all are closed."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements, self.open, self.faults = [], [], []
        self.feed(text)
        self.close()
        self.faults += [f"{self.elements[k][0]} is left open" for k in self.open]

    def handle_starttag(self, tag, attributes):
        if len(dict(attributes)) != len(attributes):
            self.faults.append(f"{tag} has an attribute twice")
        self.elements.append([tag, dict(attributes), [], self.open[-1] if self.open else None])
        if tag not in VOID:
            self.open.append(len(self.elements) - 1)

    def handle_endtag(self, tag):
        if not self.open or self.elements[self.open[-1]][0] != tag:
            self.faults.append(f"</{tag}> closes nothing")
        else:
            self.open.pop()

    def handle_data(self, data):
        for k in self.open:  # of all around it
            self.elements[k][2].append(data)

    def all(self, tag, **attributes):
        """(attributes, words) of the elements with these attributes, in order."""
        return [
            (found, " ".join("".join(words).split()))
            for name, found, words, _ in self.elements
            if name == tag and all(found.get(key) == value for key, value in attributes.items())
        ]

    def inside(self, number):
        """Return the indices of the elements whose parent is this element."""
        return [k for k, element in enumerate(self.elements) if element[3] == number]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return (directory, HTML as a tree, Markdown) of the made-up report."""
    directory = tmp_path_factory.mktemp("report") / "new" / "folder"
    path = write_report(
        invented.INVENTED,
        directory,
        f"python -m lab report --out '{invented.HOSTILE}'",
        Effort.QUICK,
        {"machine": "abacus & sons", invented.HOSTILE: invented.HOSTILE},
    )
    assert path == directory / "report.html"
    return directory, Tree(path.read_text("utf-8")), (directory / "report.md").read_text("utf-8")


def rows_of(path):
    return list(csv.reader(io.StringIO(path.read_text("utf-8"))))


def test_every_element_is_closed_where_it_belongs_and_names_are_given_once(written):
    _, page, _ = written
    assert page.faults == []
    assert page.elements[0][0] == "html"
    names = [attributes["id"] for _, attributes, _, _ in page.elements if "id" in attributes]
    assert len(set(names)) == len(names)


def test_the_page_needs_no_other_file_and_runs_nothing(written):
    _, page, _ = written
    assert {tag for tag, *_ in page.elements} & {
        "script",
        "link",
        "iframe",
        "object",
        "embed",
        "base",
    } == set()
    names = {attributes["id"] for _, attributes, _, _ in page.elements if "id" in attributes}
    for _, attributes, _, _ in page.elements:
        assert not any(key.startswith("on") for key in attributes)
        for key in ("src", "href", "srcset", "action"):
            target = attributes.get(key, "data:")
            assert target.startswith("data:") or target[1:] in names, target
    (style,) = page.all("style")
    assert "url(" not in style[1]
    assert "@import" not in style[1]


def test_every_claim_has_one_row_with_its_verdict_and_a_link_to_what_was_found(written):
    _, page, _ = written
    found = {}
    for number, (tag, attributes, _, _) in enumerate(page.elements):
        if tag == "tr" and attributes.get("id", "").startswith("claim-"):
            verdict, claim, measured, links = (page.elements[k] for k in page.inside(number))
            found[attributes["id"][6:]] = ["".join(cell[2]).strip() for cell in (verdict, claim, measured)]
            wanted = [
                f"#experiment-{'trap-b' if experiment is invented.TRAP else experiment.name}"
                for experiment, _, section in invented.INVENTED
                for finding in section.findings
                if finding.claim == attributes["id"][6:]
            ]
            at = next(k for k, element in enumerate(page.elements) if element is links)
            given = [
                page.elements[link][1]["href"]
                for paragraph in page.inside(at)
                for link in page.inside(paragraph)
            ]
            assert given == wanted
    assert list(found) == list(CLAIMS)  # in order, each once
    for key, (verdict, claim, measured) in found.items():
        assert verdict == invented.EXPECTED.get(key, "not measured")
        assert claim.startswith(CLAIMS[key].text)
        assert bool(measured) == (key in invented.EXPECTED)
    assert "1.003 E A" in found["tension-slope"][2]  # of both experiments
    assert "0.91 E A" in found["tension-slope"][2]


def test_the_summary_counts_claims_of_the_thesis_and_statements_of_theory_apart(written):
    _, page, markdown = written
    tiles = [words.split(maxsplit=1) for _, words in page.all("li", **{}) if words[0].isdigit()]
    for row, (kind, line) in enumerate(invented.COUNTS.items()):
        assert f"\nOf {kind}: {line}.\n" in markdown
        assert ", ".join(" ".join(tile) for tile in tiles[5 * row : 5 * row + 5]) == line
    assert len(tiles) == 10


def test_sections_come_in_order_with_why_and_what_failed(written):
    _, page, _ = written
    sections = page.all("section", **{"class": "experiment"})
    assert [attributes["id"] for attributes, _ in sections] == [
        "experiment-tension",
        "experiment-trap-b",
        "experiment-tension-theory",
    ]
    words = sections[0][1]
    assert "7 points, 1 failed" in words
    assert "2 s of computing" in words
    assert "Why: The model: with nu = 0 eq. 6.7" in words
    assert "poisson = 0.5, strain = 0.1" in words
    assert "OptionError: poisson must lie below 0.5" in words
    assert "Not drawn: 0 points with {'nu': 0.5}, wanted 1" in words


def test_long_tables_are_folded_and_short_ones_are_not(written):
    _, page, _ = written
    folded = [words for _, words in page.all("summary")]
    assert "Forces of all points (40 rows)" in folded
    assert not any("Slope at zero strain" in words for words in folded)
    assert any(words.startswith("Slope at zero strain") for _, words in page.all("h3"))


def test_numbers_stand_on_the_right_also_as_words(written):
    _, page, _ = written
    headings = {words: attributes.get("class") for attributes, words in page.all("th")}
    right = {words for words, kind in headings.items() if kind == "right"}
    assert {"nu [1]", "slope [N]", "over E A [1]", "spread [1]", "n"} <= right
    assert right.isdisjoint({"stable", "note", "verdict"})


def test_a_wide_plot_has_a_row_for_itself(written):
    _, page, _ = written
    wide = [words for _, words in page.all("figure", **{"class": "plot wide"})]
    assert wide == ["Many lines in a wide plot."]


def test_any_text_is_shown_as_it_is(written):
    _, page, _ = written
    wanted = " ".join(invented.HOSTILE.split())
    for tag in ("h2", "figcaption", "td", "th", "dt", "dd", "code", "pre", "h3"):
        assert any(wanted in words for _, words in page.all(tag)), tag
    assert any(attributes["alt"] == invented.HOSTILE for attributes, _ in page.all("img"))


def test_images_are_those_of_the_files_at_the_stated_size(written):
    directory, page, _ = written
    files = sorted([*directory.glob("plots/*"), *directory.glob("pictures/*")])
    embedded = {}
    for attributes, _ in page.all("img"):
        kind, data = attributes["src"].split(",")
        assert kind == "data:image/png;base64"
        embedded[base64.b64decode(data)] = (int(attributes["width"]), int(attributes["height"]))
    assert len(files) == len(embedded) == 7
    for path in files:
        width, height = embedded[path.read_bytes()]
        scale = 2 if path.parent.name == "plots" else 1
        image = cv2.imread(str(path))
        assert image.shape == (scale * height, scale * width, 3)
        assert image.std() > 10.0  # something is drawn
    np.testing.assert_array_equal(
        cv2.imread(str(directory / "pictures/tension-cylinder.png"))[:, :, ::-1], invented.gradient(320, 200)
    )
    assert embedded[(directory / "plots/tension-force.png").read_bytes()] == (614, 384)


def test_ten_lines_of_a_plot_can_be_told_apart():
    seen = set()

    def draw(figure):
        axes = figure.add_subplot()
        for k in range(10):
            axes.plot([0, 1], [k, k])
        seen.update((line.get_color(), line.get_linestyle()) for line in axes.lines)

    png_of(Plot("lines", "", draw, (2.0, 1.5)))
    assert len(seen) == 10


def test_plots_are_not_cut_off_at_their_edges(written):
    """Labels would be, where the layout of axes of a fixed aspect is left as it is after one pass."""
    directory, _, _ = written
    for name in ("force", "map", "many"):
        image = cv2.imread(str(directory / f"plots/tension-{name}.png"))
        inner = image[3:-3, 3:-3]
        assert image.astype(np.int64).sum() - inner.astype(np.int64).sum() == 255 * (image.size - inner.size)


def test_tables_in_files_and_in_the_page_hold_every_digit(written):
    directory, page, _ = written
    for table in invented.TENSION_SECTION.tables:
        path = directory / f"tables/tension-{table.name}.csv"
        heading, *rows = rows_of(path)
        assert tuple(heading) == table.columns
        assert len(rows) == len(table.rows)
        for row, wanted in zip(rows, table.rows, strict=True):
            for cell, value in zip(row, wanted, strict=True):
                if isinstance(value, bool):
                    assert json.loads(cell) is value
                elif isinstance(value, (int, float)):
                    assert float(cell) == value
                else:
                    assert cell == ("" if value is None else value)
        (link,) = (a for a, _ in page.all("a", download=path.name))
        assert base64.b64decode(link["href"].split(",")[1]) == path.read_bytes()


def test_points_in_files_hold_every_digit(written):
    directory, _, _ = written
    heading, *rows = rows_of(directory / "points/tension.csv")
    assert heading == [
        *("point.poisson", "point.strain", "measured.force", "measured.cap", "measured.stable"),
        *("error", "seconds"),
    ]
    for cells, row in zip(rows, invented.TENSION_RESULTS.rows, strict=True):
        found = dict(zip(heading, cells, strict=True))
        assert {name: float(found[f"point.{name}"]) for name in row.point} == row.point
        for name in ("force", "cap", "stable"):
            cell = found[f"measured.{name}"]
            assert (json.loads(cell) if cell else None) == (row.numbers or {}).get(name)
        assert found["error"] == row.error
        assert float(found["seconds"]) == row.seconds


def test_the_verdicts_file_has_every_finding_and_every_claim(written):
    directory, _, _ = written
    rows = list(csv.DictReader(io.StringIO((directory / "verdicts.csv").read_text("utf-8"))))
    wanted = {
        (finding.claim, finding.verdict.value, finding.measured, finding.why, experiment.name)
        for experiment, _, section in invented.INVENTED
        for finding in section.findings
    } | {(key, "not measured", "", "", "") for key in CLAIMS if key not in invented.EXPECTED}
    names = ("claim", "verdict", "measured", "why", "experiment")
    assert {tuple(row[name] for name in names) for row in rows} == wanted
    assert len(rows) == len(wanted)
    chapters = {row["claim"]: row["chapter"] for row in rows}
    assert chapters["decay-explicit"].startswith("Chapter 3")
    assert chapters["shear-modulus-volume"].startswith("Chapter 5")
    assert chapters["hertz"] == "Beyond the thesis: theory"


def test_links_of_the_markdown_lead_somewhere(written):
    directory, _, markdown = written
    anchors = set(re.findall(r'<a id="([^"]+)"></a>', markdown))
    targets = re.findall(r"(?<!\\)\]\(([^)]+)\)", markdown)
    files = {target for target in targets if not target.startswith("#")}
    assert {target[1:] for target in targets if target.startswith("#")} == anchors
    assert all((directory / target).is_file() for target in files)
    on_disk = {path.relative_to(directory).as_posix() for path in directory.rglob("*") if path.is_file()}
    assert on_disk - files == {"report.html", "report.md", "verdicts.csv"}


def test_tables_of_the_markdown_have_as_many_cells_in_every_row(written):
    _, _, markdown = written
    blocks = re.findall(r"(?:^\|.*\n)+", markdown, flags=re.MULTILINE)
    assert len(blocks) == 6 + 3 + 1
    for block in blocks:
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in block.splitlines()}) == 1


def test_markdown_takes_any_text_literally():
    """Escaping is undone by taking the backslashes away, and nothing that means something stays bare."""
    for text in (invented.HOSTILE, "# no heading", "1. no list", "- none", "+ none", "---", "===", "a_b_c"):
        quoted = escaped(text)
        assert re.sub(r"\\([\\`*_\[\]<>|&~$#.)\-+=])", r"\1", quoted) == " ".join(text.split())
        assert re.search(r"(?<!\\)(?:\\\\)*[`*_\[\]<>|]", quoted) is None
        assert re.match(r"#|[-+] |\d+[.)] |[-=]+$", quoted) is None
    assert [escaped(text) for text in ("0.337", "-0.5", "two\nlines")] == ["0.337", "-0.5", "two lines"]


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (1.0, "1"),
        (0.123456, "0.1235"),
        (1234.56, "1235"),
        (-99999.4, "-99999"),
        (3e6, "3e6"),
        (123456.0, "1.235e5"),
        (6.673e-7, "6.673e-7"),
        (1e-10, "1e-10"),
        (2e100, "2e100"),
        (955, "955"),
        (np.float64(0.5), "0.5"),
        (np.bool_(False), "no"),
        (float("nan"), "nan"),
        (None, "–"),
        ([1.5, None], "1.5, –"),
    ],
)
def test_cells_are_read_easily(value, words):
    assert readable(value) == words


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("8.3e+02 times", "830 times"),
        ("1.1e-02 s, 7.2e+02, 1.25e+04", "0.011 s, 720, 12500"),
        ("(E = 1e+06 Pa)", "(E = 1e6 Pa)"),
        ("5.6e+05 to 3e-07", "5.6e5 to 3e-7"),
        ("1.234e+02 and -2.5e-01", "123.4 and -0.25"),
        ("figure 6.2e+x, v1e+02, 0.5", "figure 6.2e+x, v1e+02, 0.5"),
    ],
)
def test_numbers_in_sentences_are_read_easily(text, words):
    assert legible(text) == words


def test_durations_are_read_easily():
    assert [duration(s) for s in (0.0, 0.123, 42.0, 150.0, 3000.0, 9000.0)] == [
        *("0 s", "0.12 s", "42 s", "2.5 min", "50 min", "2.5 h")
    ]


def changed(**parts):
    """Return a made-up experiment whose section has other contents."""
    section = replace(Section((), ()), **parts)
    return [(invented.SECOND, Results(), section)]


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        (changed(findings=(Finding("no-such", "x", Verdict.AGREES),)), "'no-such', which is no claim"),
        (changed(tables=(Table("t", "t", ("a", "b"), ((1,),)),)), "2 columns and a row of 1"),
        (changed(tables=(Table("t 1", "", (), ()), Table("T-1", "", (), ()))), "two files of the name 'T-1'"),
        (changed(pictures=(Picture("p", "", np.zeros((4, 4), np.uint8)),)), "must be uint8"),
        (invented.INVENTED + invented.INVENTED[:1], "two files of the name 'tension'"),
    ],
)
def test_what_cannot_be_shown_is_refused_before_anything_is_written(sections, said, tmp_path):
    with pytest.raises(OptionError, match=re.escape(said)):
        write_report(sections, tmp_path, "c", Effort.QUICK, {})
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_leaves_the_old_report_whole(tmp_path, monkeypatch):
    write_report(changed(text=("old",)), tmp_path, "c", Effort.QUICK, {})
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    original, left = Path.write_bytes, [3]

    def write_bytes(path, data):
        left[0] -= 1
        if left[0] < 0:
            original(path, data[: len(data) // 2])
            raise OSError(28, "No space left on device")
        return original(path, data)

    monkeypatch.setattr(Path, "write_bytes", write_bytes)
    with pytest.raises(OptionError, match="No space left on device"):
        write_report(changed(text=("new",)), tmp_path, "c", Effort.QUICK, {})
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_a_file_where_the_directory_should_be_is_refused(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OptionError, match="cannot write the report"):
        write_report([], tmp_path / "file", "c", Effort.QUICK, {})
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("name", ["jinja2", "matplotlib"])
def test_a_missing_package_is_named_with_its_extra(name, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(OptionError, match=rf"needs {name}, .*pip install -e '\.\[lab\]'"):
        write_report([], tmp_path / "new", "c", Effort.QUICK, {})
    assert not (tmp_path / "new").exists()


def test_plots_leave_the_settings_of_matplotlib_alone(tmp_path, monkeypatch):
    import matplotlib

    monkeypatch.setitem(matplotlib.rcParams, "font.size", 7.5)
    before = dict(matplotlib.rcParams)
    write_report(
        [(invented.TRAP, Results(), replace(Section((), ()), plots=invented.TRAP_SECTION.plots))],
        *(tmp_path, "c", Effort.FULL, {}),
    )
    assert dict(matplotlib.rcParams) == before
