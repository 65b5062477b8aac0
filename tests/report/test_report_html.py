"""The page: verdict first, the numbers of the JSON, nothing from elsewhere."""

from __future__ import annotations

import base64
import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from report_analyses import Case, case, flown, refused, still
from report_page import Content, content_of
from truth import REAL

from magcomp.analysis import Options, analyse, parameter_set
from magcomp.model import Grade
from magcomp.report.as_html import html
from magcomp.report.plain import doubts, pilots_lines
from magcomp.sources import read
from magcomp.writing.files import parse_parameters

CASES = [still, flown, refused]
MOST_BYTES = 5_000_000
EXTERNAL = re.compile(r"^(https?:)?//", re.IGNORECASE)


@cache
def page_of(make) -> str:
    made: Case = make()
    return html(made.recording, made.analysis, options=made.options)


@cache
def content(make) -> Content:
    return content_of(page_of(make))


def at(document: Any, key: str) -> Any:
    for step in key.split("."):
        document = document[int(step) if isinstance(document, list) else step]
    return document


class TestNumbers:
    @pytest.mark.parametrize("make", CASES)
    def test_every_number_is_the_one_in_the_json(self, make) -> None:
        document = make().document
        shown = content(make).numbers
        assert shown
        for number in shown:
            assert number.value == at(document, number.key), number

    @pytest.mark.parametrize("make", CASES)
    def test_what_is_read_is_the_number_rounded(self, make) -> None:
        for number in content(make).numbers:
            text = number.text.replace("\N{MINUS SIGN}", "-")
            decimals = len(text.partition(".")[2])
            # A parameter loses the noughts at its end, so it is never coarser than it looks.
            half = 0.5 * 10.0 ** -max(decimals, 4 if "parameters" in number.key else 0)
            assert abs(float(text) - number.value * number.scale) <= half * 1.000001, number

    @pytest.mark.parametrize("make", CASES)
    def test_every_number_that_matters_is_shown(self, make) -> None:
        shown = {number.key for number in content(make).numbers}
        for index, compass in enumerate(make().document["compasses"]):
            here = f"compasses.{index}"
            assert {f"{here}.parameters.{name}" for name in compass["parameters"]} <= shown
            for row in range(len(compass["heading_error_deg"])):
                cells = compass["heading_error_deg"][row]
                # Below the fit's bound, what is in force is shown by that bound.
                known = ["before"] if cells["before"] > cells["p95"] else []
                for name in ("u", *known, "after", "p95"):
                    assert f"{here}.heading_error_deg.{row}.{name}" in shown
            for name in ("before", "after", "held_out", "held_out_before"):
                assert f"{here}.field_residual_mgauss.{name}" in shown
            for axis in range(3):
                assert f"{here}.interference_mgauss.{axis}" in shown
            assert f"{here}.lag_s.regressor" in shown

    @pytest.mark.parametrize("make", CASES)
    def test_the_json_is_in_the_page(self, make) -> None:
        assert content(make).json("result") == make().document

    def test_the_command_it_names_gives_this_answer(self) -> None:
        assert "--compass 1 -o compass.param" in content(flown).text

    def test_a_number_that_does_not_exist_is_said_in_words(self) -> None:
        assert still().document["compasses"][0]["lag_s"]["field"] is None
        assert "not visible to this method" in content(still).text


class TestVerdict:
    def test_a_good_fit_says_so_first(self) -> None:
        (first,) = pilots_lines(flown().document)
        assert content(flown).headings[0] == first
        assert first.endswith("Write them.")

    def test_a_rejected_fit_says_so_first(self) -> None:
        found = content(refused)
        assert found.headings[0].startswith("Do not write these numbers. ")
        assert found.headings[1] == "What to do"

    @pytest.mark.parametrize("make", CASES)
    def test_every_doubt_is_given_and_the_summary_of_another_load_is_not(self, make) -> None:
        text = content(make).text.lower()
        for compass in make().document["compasses"]:
            told = doubts(compass["reasons"], compass["verdict"])
            for reason in compass["reasons"]:
                assert (reason.lower().rstrip(".") in text) == (reason in told)

    def test_a_rejected_fit_offers_no_parameter_file(self) -> None:
        assert content(refused).links == []
        assert "Save the parameter file" not in content(refused).text

    @pytest.mark.parametrize("make", [still, flown])
    def test_the_offered_file_holds_exactly_what_would_be_written(self, make) -> None:
        (link,) = content(make).links
        text = base64.b64decode(link.removeprefix("data:text/plain;base64,")).decode()
        offered = parse_parameters(text, "offered.param")
        assert offered.values == parameter_set(make().analysis).values
        assert offered.vehicle == make().recording.vehicle


class TestPictures:
    @pytest.mark.parametrize("make", CASES)
    def test_every_picture_has_its_place_and_every_place_its_picture(self, make) -> None:
        found = content(make)
        assert len(set(found.canvases)) == len(found.canvases)
        assert set(found.canvases) == set(found.json("figures"))

    @pytest.mark.parametrize("make", CASES)
    def test_every_picture_says_in_one_sentence_what_to_see(self, make) -> None:
        found = content(make)
        assert len(found.captions) == len(found.canvases)
        for caption in found.captions:
            assert re.fullmatch(r"[A-Z].*[a-z°)]\.", caption), caption
            assert not re.search(r"[.!?] [A-Z]", caption), caption

    @pytest.mark.parametrize("make", CASES)
    def test_every_axis_has_a_title(self, make) -> None:
        for name, figure in content(make).json("figures").items():
            layout: Mapping[str, Any] = figure["layout"].get("scene", figure["layout"])
            for key, axis in layout.items():
                if re.fullmatch(r"[xyz]axis\d*", key) and not (
                    name.startswith("residuals") and key == "yaxis"
                ):
                    assert axis["title"]["text"], (name, key)

    @pytest.mark.parametrize("make", CASES)
    def test_the_drawn_heading_errors_are_those_of_the_json(self, make) -> None:
        for compass in make().document["compasses"]:
            figure = content(make).json("figures")[f"heading-{compass['compass']}"]
            traces = {trace["name"]: trace["y"] for trace in figure["data"]}
            for name, key in (
                ("correction in force", "before"),
                ("with the fit, expected", "after"),
                ("with the fit, 95 % bound", "p95"),
            ):
                expected = [row[key] for row in compass["heading_error_deg"]]
                assert traces[name] == pytest.approx(expected, abs=0.0005)

    def test_no_point_of_a_picture_is_nan(self) -> None:
        # json.loads would take NaN, a browser would not.
        for make in CASES:
            assert not re.search(r"\b(NaN|Infinity)\b", content(make).scripts["figures"])


class TestSelfContained:
    @pytest.mark.parametrize("make", CASES)
    def test_it_is_smaller_than_five_megabytes(self, make) -> None:
        assert len(page_of(make).encode()) < MOST_BYTES

    @pytest.mark.slow
    def test_three_compasses_turned_at_five_levels_stay_below_five_megabytes(self) -> None:
        made = case("turntable_five_levels")
        assert len(made.analysis.compasses) == 3
        assert len(html(made.recording, made.analysis).encode()) < MOST_BYTES

    @pytest.mark.parametrize("make", CASES)
    def test_nothing_is_asked_for_from_elsewhere(self, make) -> None:
        found = content(make)
        assert not any(EXTERNAL.match(link) for link in found.links)
        assert not found.tags & {"link", "iframe", "object", "embed", "base", "form"}

    @pytest.mark.parametrize("make", CASES)
    def test_the_browser_is_told_to_refuse_what_is_elsewhere(self, make) -> None:
        policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page_of(make))
        assert policy is not None
        assert policy[1].startswith("default-src 'none';")
        assert "http" not in policy[1]

    def test_a_name_cannot_become_part_of_the_page(self) -> None:
        made = flown()
        name = "</script><script>alert('`1`')</script>&\"<b>.tlog"
        found = content_of(html(made.recording, replace(made.analysis, source=name)))
        assert found.json("result")["source"] == name
        assert name in found.text
        assert "b" not in found.tags - content(flown).tags
        assert not any("alert" in script for script in found.scripts.values() if "{" not in script)

    def test_making_it_needs_no_terminal_screen_and_no_plotting(self) -> None:
        code = (
            "import sys, magcomp.report.as_html, magcomp.report.files;"
            "print(sorted({'textual', 'plotly'} & set(sys.modules)))"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        assert done.stdout.decode().strip() == "[]"


class TestOtherRecordings:
    def test_a_recording_without_a_compass_shows_the_others(self) -> None:
        recording = still().recording
        without = replace(recording, field={2: recording.field[2]})
        found = content_of(html(without, analyse(without)))
        assert "Compass 2" in found.text
        assert "Compass 1" not in found.text
        assert {name.rpartition("-")[2] for name in found.canvases} == {"2"}

    def test_a_recording_without_parameters_says_they_are_not_known(self) -> None:
        recording = still().recording
        bare = replace(recording, parameters=type(recording.parameters)())
        assert "not in the log" in content_of(html(bare, analyse(bare))).text

    @pytest.mark.parametrize("name", ["quad_2013", "quad_2015"])
    def test_a_real_flight_of_a_poor_compass_is_told_honestly(self, name: str) -> None:
        path = REAL / f"{name}.tlog"
        if not path.exists():
            pytest.skip("the real logs are not here")
        recording = read(path)
        options = Options(compass=1)
        analysis = analyse(recording, options)
        found = content_of(html(recording, analysis, options=options))
        grade = analysis.compasses[0].verdict.grade
        assert found.headings[0].startswith("Do not write") == (grade is Grade.REJECTED)
        assert json.loads(found.scripts["result"])["verdict"] == grade.value
