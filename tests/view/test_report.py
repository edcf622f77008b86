"""Tables as text and HTML, engineering prefixes, the progress line, JSON, pages and their charts."""

from __future__ import annotations

import io
import json
import re
import time
from html.parser import HTMLParser

import mbrs as mb
import numpy as np
import pytest
from mbrs import plot
from mbrs._lib.jsonable import dumps, result_data
from mbrs._lib.progress import Elapsed, Progress
from mbrs._lib.text import html_table, number, si, table, without_rounding
from mbrs.errors import ModelError
from mbrs.view import modes as viewer
from mbrs.view.page import Section, page
from small_results import isolator_modes, isolator_sensitivity, row_frf


def test_numbers_line_up_at_the_decimal_point() -> None:
    text = table(["mode", "f [Hz]"], [[1, 15.9155], [2, 6.7553], [10, 0.0]])
    lines = text.splitlines()
    assert lines[2].endswith("15.9155") and lines[3].endswith(" 6.7553") and lines[4].endswith("      0")
    assert len({len(line) for line in lines}) == 1


def test_absent_values_and_complex_numbers() -> None:
    text = table(["s", "zeta"], [[-1.5 + 100j, float("nan")], [complex(0, -2), None]])
    assert "-1.5 + 100i" in text and "0 - 2i" in text
    assert [line.split()[-1] for line in text.splitlines()[2:]] == ["-", "-"]


def test_numbers_that_come_as_text_are_aligned_as_well() -> None:
    lines = table(["a", "b", "c"], [["1.5", 2, "x"], ["-", "", "1"], ["12e-3", 10, "y"]]).splitlines()
    assert lines[2:] == ["  1.5   2  x", "    -      1", "12e-3  10  y"]


def test_a_wide_range_keeps_the_digits_of_small_values() -> None:
    text = table(["x"], [[1.23456e-9], [4.56789e6]])
    assert "1.23456e-09" in text and "4.56789e+06" in text


@pytest.mark.parametrize(
    "value", [1e300, 1e-300, np.inf, -np.inf, -0.0, np.float32(0.1), np.int64(7), True, [1.0, 2.0]]
)
def test_every_value_prints(value: object) -> None:
    assert number(value)
    assert table(["v"], [[value]]).splitlines()[-1].strip()


def test_minus_zero_is_zero() -> None:
    assert number(-0.0) == "0"
    assert table(["v"], [[-0.0], [1.5]]).splitlines()[2].strip() == "0"


def test_wide_tables_shorten_text_then_fold_and_lose_no_number() -> None:
    values = np.arange(30) + 0.123456
    text = table([f"c{i}" for i in range(31)], [["a very long name of a body " * 3, *values]], width=60)
    assert max(len(line) for line in text.splitlines()) <= 60
    for value in values:
        assert f"{value:.4f}"[:6] in text
    assert text.count("a very") == sum("----" in line for line in text.splitlines()) > 1


def test_long_tables_say_what_they_leave_out() -> None:
    text = table(["i"], [[i] for i in range(1000)], max_rows=30)
    assert "(1000 rows, 970 of them not shown)" in text and "999" in text
    assert len(text.splitlines()) == 2 + 31 + 1
    assert len(table(["i"], [[i] for i in range(1000)], max_rows=None).splitlines()) == 1002


def test_a_row_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(ModelError, match="row 1 of the table has 3 values, but there are 2 columns"):
        table(["a", "b"], [[1, 2], [1, 2, 3]])


def test_empty_table() -> None:
    assert table(["a", "b"], []).splitlines()[0] == "a  b"


def test_html_escapes_everything() -> None:
    text = html_table(["<b>"], [["<script>alert(1)</script>"]], title="a & b", footer="x < y")
    assert "<script>" not in text and "<b>" not in text and "a &amp; b" in text and "x &lt; y" in text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.5e5, "N/m", "150 kN/m"),
        (0.0, "m", "0 m"),
        (999.97, "m", "1 km"),
        (-2.5e-7, "s", "-250 ns"),
        (20.0, "kg", "20 kg"),
        (1e-20, "m", "1e-05 fm"),
        (3.0, "", "3"),
        (0.02, "m^2", "0.02 m^2"),
        (float("inf"), "Hz", "inf Hz"),
    ],
)
def test_engineering_prefixes(value: float, unit: str, text: str) -> None:
    assert si(value, unit) == text


class _Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def _progress(monkeypatch: pytest.MonkeyPatch, wanted: str, steps: int, each: float) -> str:
    monkeypatch.setenv("MBRS_PROGRESS", wanted)
    clock, stream = _Clock(), io.StringIO()
    with Progress("frequencies", steps, stream=stream, clock=clock) as progress:
        for i in range(steps):
            clock.now += each
            progress.advance(note=f"{i} Hz")
    return stream.getvalue()


def test_progress_is_silent_for_short_work(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _progress(monkeypatch, "1", 9, 0.1) == ""


def test_progress_is_silent_without_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _progress(monkeypatch, "", 100, 0.1) == ""
    assert _progress(monkeypatch, "0", 100, 0.1) == ""


def test_progress_updates_one_line_and_clears_it(monkeypatch: pytest.MonkeyPatch) -> None:
    text = _progress(monkeypatch, "1", 50, 0.25)
    assert "frequencies    8 % (4/50), 12 s left  3 Hz" in text
    assert _screen(text) == ""
    assert _screen(text[: text.index("Hz", text.index("92 %")) + 2]) == "frequencies   92 % (46/50), 1 s left  45 Hz"


def test_progress_is_cut_at_the_width_of_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MBRS_PROGRESS", "1")
    monkeypatch.setenv("COLUMNS", "40")
    clock, stream = _Clock(), io.StringIO()
    with Progress("frequencies", 10, stream=stream, clock=clock) as progress:
        for _ in range(4):
            clock.now += 0.7
            progress.advance(note="a note that is longer than what is left of the line")
        text = stream.getvalue()
    assert len(_screen(text)) == 40 and _screen(text).endswith("…")
    assert _screen(stream.getvalue()) == ""


def _screen(text: str) -> str:
    """What a terminal shows after these characters: one line, returns and the codes that erase it."""
    line = ""
    for part in re.findall(r"\x1b\[\?25[lh]|\x1b\[\d*[A-Za-z]|\r|\n|[^\x1b\r\n]+", text):
        if part == "\r":
            continue
        if part in ("\x1b[2K",):
            line = ""
        elif not part.startswith("\x1b") and part != "\n":
            line = part
    return line


def test_progress_survives_a_closed_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MBRS_PROGRESS", "1")
    stream, clock = io.StringIO(), _Clock()
    stream.close()
    with Progress("x", 10, stream=stream, clock=clock) as progress:
        clock.now = 5.0
        progress.advance(3)
    assert progress.done == 3


def test_json_holds_no_nan_and_splits_complex_numbers() -> None:
    modes = mb.modes(mb.MechanicalSystem(np.eye(2), None, np.diag([0.0, 9.0])))
    assert np.isnan(modes.damping[0])
    data = json.loads(dumps(result_data(modes, ("frequency", "damping", "eigenvalue", "absent"))))
    assert data["damping"][0] is None and data["frequency"][1] == modes.frequency[1]
    assert data["eigenvalue"]["im"][1] == pytest.approx(modes.eigenvalue[1].imag)
    assert "absent" not in data and data["stats"]["counts"] == modes.stats.counts


class _Balanced(HTMLParser):
    """Checks that every tag is closed in order, and collects what the page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loads += [value or "" for name, value in attrs if name in ("src", "href", "xlink:href")]
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loads += [value or "" for name, value in attrs if name in ("src", "href", "xlink:href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open.pop() == tag, f"</{tag}> closes nothing"


def _check_page(text: str) -> None:
    parser = _Balanced()
    parser.feed(text)
    assert parser.open == []
    assert all(one.startswith(("data:", "#")) for one in parser.loads)
    # no address of any kind: the page needs no network
    assert not re.search(r"https?:|//[a-z]+\.[a-z]|@import|url\((?!#)", text)


def test_a_page_is_complete_and_needs_no_network() -> None:
    modes = isolator_modes()
    sections = [
        Section("Modes <1>", [table(["f"], [[1.0]]), html_table(["f"], [[1.0]]), viewer.modes(modes)], "a < b"),
        ("Transfer function", plot.frf(row_frf(2, 2), marks=modes.frequency)),
        ("Sensitivities", [plot.tornado(isolator_sensitivity())]),
    ]
    text = page("A & B", sections, intro="x < y")
    _check_page(text)
    assert "<h2>Modes &lt;1&gt;</h2>" in text and "x &lt; y" in text and "<title>A &amp; B</title>" in text
    assert text.count("const mbrsViewer") == 1


def test_the_viewer_is_only_on_pages_that_need_it() -> None:
    assert "mbrsViewer" not in page("t", [("s", "text")])


def test_a_page_takes_matplotlib_figures_as_svg() -> None:
    text = page("t", [("s", [plot.tornado(isolator_sensitivity()), plot.frf(row_frf())])])
    _check_page(text)
    assert text.count("<svg") == 2 and "metadata" not in text and "xmlns" not in text
    # what one picture names is not what the other names
    names = re.findall(r'<clipPath id="([^"]+)"', text)
    assert len(names) == len(set(names)) >= 3


def test_an_empty_page_is_refused() -> None:
    with pytest.raises(ModelError, match="at least one section"):
        page("t", [])


def test_rounding_prints_as_zero_and_everything_else_stays() -> None:
    rng = np.random.default_rng(71)
    for _ in range(50):
        scale = 10.0 ** rng.uniform(-30, 30)
        values = scale * rng.uniform(0.1, 1.0, 7) * rng.choice([-1.0, 1.0], 7)
        noise = scale * np.finfo(float).eps * rng.uniform(-6.0, 6.0, 5)
        shown = without_rounding([*values, *noise])
        assert np.array_equal(shown[:7], values) and not shown[7:].any() and not np.signbit(shown[7:]).any()
        small = 1e-6 * scale * rng.uniform(0.5, 1.0)
        assert without_rounding([*values, small])[-1] == small
        assert without_rounding([*values, small], error=1e-5)[-1] == 0.0
    assert np.isnan(without_rounding([np.nan, 1.0])[0]) and np.isinf(without_rounding([np.inf, 1.0])[0])
    assert without_rounding([1e-20, 3.0], scale=1.0).tolist() == [0.0, 3.0]


def test_a_call_that_cannot_count_shows_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread writes the line while the caller is busy; the line is cleared at the end, and without a terminal nothing runs."""
    monkeypatch.setattr("mbrs._lib.progress._QUIET_FOR", 0.0)
    monkeypatch.setattr("mbrs._lib.progress._EVERY", 0.005)
    monkeypatch.setenv("MBRS_PROGRESS", "1")
    stream = io.StringIO()
    with Elapsed("lowest modes", stream=stream) as progress:
        deadline = time.monotonic() + 20.0
        while "lowest modes" not in stream.getvalue() and time.monotonic() < deadline:
            time.sleep(0.001)
        ticker = progress._ticker
    assert "lowest modes  0 s" in stream.getvalue() and _screen(stream.getvalue()) == ""
    assert ticker is not None and not ticker.is_alive()
    monkeypatch.setenv("MBRS_PROGRESS", "0")
    with Elapsed("lowest modes", stream=stream) as progress:
        assert progress._ticker is None
