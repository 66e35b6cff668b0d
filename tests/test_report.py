"""The report: one file that needs nothing else, with pictures that decode, and that a browser can show."""

import base64
import html.parser
import re
import shutil
import subprocess

import matplotlib.pyplot as plt
import numpy as np
import pytest
import rigs

import ctrl_df as cdf
from ctrl_df.identify.improve import improve
from ctrl_df.identify.report import write_report
from ctrl_df.numerals import percent

BROWSER = next(
    (b for b in ("chromium", "chromium-browser", "google-chrome", "firefox") if shutil.which(b)), None
)


@pytest.fixture(scope="module")
def study():
    rig = rigs.draw("linear_spring", 14, excitation="multisine", snr_db=60, n=500)
    train, held = rig.train[0].measurement(), rig.holdout[0].measurement()
    return improve(rig.baseline, train, held, candidates=("linear_spring",), max_effects=1)


@pytest.fixture(scope="module")
def path(study, tmp_path_factory):
    return write_report(study, tmp_path_factory.mktemp("report") / "report.html")


class Page(html.parser.HTMLParser):
    """Collects what a page refers to, shows and says."""

    def __init__(self, text):
        super().__init__()
        self.references, self.pictures, self.headings, self.words = [], [], [], []
        self.open, self.rows = [], 0
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.references += [
            v for k, v in given.items() if k in ("href", "src", "srcset", "action") and v is not None
        ]
        if tag == "img":
            self.pictures.append((given["src"], given.get("alt", "")))
        if tag == "tr":
            self.rows += 1
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag, f"</{tag}> closes nothing"

    def handle_data(self, data):
        if self.open and self.open[-1] in ("h1", "h2", "title"):
            self.headings.append(data)
        if "style" not in self.open:
            self.words.append(data)


def page_of(path):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    return Page(text), text


# a ladder and its report, with all that both stand on
@pytest.mark.quick
def test_it_needs_nothing_else(path):
    page, text = page_of(path)
    assert not page.open, f"left open: {page.open}"
    assert all(r.startswith("data:image/png;base64,") for r in page.references)
    assert "http" not in re.sub(r"base64,[A-Za-z0-9+/=]*", "", text)
    assert "<script" not in text and "@import" not in text and "url(" not in text


def test_pictures_decode_and_are_described(path):
    page, _ = page_of(path)
    assert len(page.pictures) >= 4  # ladder, before, after, ranking
    for source, description in page.pictures:
        data = base64.b64decode(source.partition(",")[2], validate=True)
        assert data[:8] == b"\x89PNG\r\n\x1a\n"
        width, height = (int.from_bytes(data[i : i + 4], "big") for i in (16, 20))
        assert width > 500 and height > 200
        assert len(description) > 10


@pytest.mark.quick
def test_it_tells_the_story(path, study):
    page, _ = page_of(path)
    words = " ".join(page.words)
    for heading in ("The ladder", "The model", "Model and measurement", "Step by step"):
        assert heading in page.headings
    assert "linear spring" in words and "Standard error" in words and "±" in words
    assert percent(study.steps[-1].nrmse_holdout) in words
    assert page.rows >= len(study.steps) + 2 + len(study.model.parameters)
    assert "%%" not in words and "$" not in words and "nan" not in words.split()


def test_no_picture_is_left_open(study, tmp_path):
    before = plt.get_fignums()
    write_report(study, tmp_path / "again.html")
    assert plt.get_fignums() == before


def test_a_name_cannot_break_the_page(study, tmp_path):
    import dataclasses

    sly = study.train[0].slice()
    object.__setattr__(sly, "name", "<script>alert(1)</script> & co")
    page, text = page_of(write_report(dataclasses.replace(study, train=(sly,)), tmp_path / "sly.html"))
    assert "<script" not in text
    assert any("<script>alert(1)</script> & co" in h for h in page.headings)


def test_a_folder_that_is_not_there(study, tmp_path):
    with pytest.raises(FileNotFoundError, match="existing directory"):
        write_report(study, tmp_path / "no" / "report.html")


def test_a_report_of_tables(tmp_path):
    A, omega = np.geomspace(9, 60, 4), np.geomspace(2, 40, 3)
    true = cdf.friction_mass(mass=9, coulomb=5, viscous=20).with_effect(cdf.LinearSpring(150.0))
    N = cdf.describing_function(true, A[:, None], omega[None])
    rng = np.random.default_rng(2)
    N = N * (1 + 0.003 * rng.standard_normal(N.shape))
    start = cdf.friction_mass(mass=10, coulomb=5, viscous=20)
    found = improve(
        start, cdf.FrequencyMeasurement(A, omega, N), candidates=("linear_spring",), max_effects=1
    )
    page, _ = page_of(write_report(found, tmp_path / "table.html"))
    words = " ".join(page.words)
    assert "linear spring" in words and "|N|" in words and "4 amplitudes" in words


@pytest.mark.skipif(BROWSER is None, reason="no headless browser is installed")
@pytest.mark.parametrize("width", [1280, 400])
def test_a_browser_shows_it(path, tmp_path, width):
    picture = tmp_path / "shot.png"
    options = ["--headless", f"--screenshot={picture}"]
    if BROWSER == "firefox":
        options += ["--window-size", f"{width},2400", "--profile", str(tmp_path)]
    else:
        options += [
            "--disable-gpu",
            "--no-sandbox",
            f"--window-size={width},2400",
            f"--user-data-dir={tmp_path}",
        ]
    subprocess.run(
        [BROWSER, *options, f"file://{path}"], check=True, timeout=120, capture_output=True, cwd=tmp_path
    )
    shown = plt.imread(picture)
    assert shown.shape[1] == width and shown.shape[0] > 1000
    grey = shown[..., :3].mean(axis=2)
    # text and pictures all the way down, and the blue of the verdict
    for part in np.array_split(grey, 4):
        assert part.std() > 0.03
    blue = (shown[..., 2] - shown[..., 0] > 0.3).sum()
    assert blue > 1000
