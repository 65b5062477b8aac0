"""The pilot's line: no statistics, one current everywhere, and what to do with each compass."""

from __future__ import annotations

import copy
import re
from typing import Any

import pytest
from report_analyses import flown, refused, still

from magcomp.model import Grade
from magcomp.report import as_text, words
from magcomp.report.advice import steps
from magcomp.report.look import Look
from magcomp.report.plain import pilots_lines, table_rows
from magcomp.report.roles import roles

STATISTICS = re.compile(r"95 %|mGauss|sigma|σ|residual|unexplained|straight", re.IGNORECASE)


def changed(document: dict[str, Any], compass: int, **values: Any) -> dict[str, Any]:
    """The document with other values for one of its compasses."""
    other = copy.deepcopy(document)
    for found in other["compasses"]:
        if found["compass"] == compass:
            found.update(values)
    return other


def text_of(make, **options: Any) -> str:
    return as_text.analysis_text(make().analysis, {}, {}, Look(), **options)


def actions(document: dict[str, Any]) -> dict[int, str]:
    return {role.compass: role.action for role in roles(document)}


class TestFirstLine:
    def test_a_fit_says_how_wrong_how_much_less_and_what_to_do(self) -> None:
        (line,) = pilots_lines(flown().document)
        assert re.fullmatch(
            r"At hover \(\d+ A\) your compass is \d+° wrong\. "
            r"With these numbers: at most \d\.\d+°\. Write them\.",
            line,
        )

    @pytest.mark.parametrize("make", [still, flown])
    def test_it_has_no_statistics(self, make) -> None:
        assert not STATISTICS.search(" ".join(pilots_lines(make().document)))

    def test_it_names_the_numbers_of_the_quoted_row(self) -> None:
        document = flown().document
        row = document["compasses"][0]["quoted"]
        (line,) = pilots_lines(document)
        assert f"({row['u']:.0f} A)" in line
        assert words.degrees(row["before"]) in line
        assert words.degrees(row["p95"]) in line

    def test_a_compass_that_is_switched_off_makes_no_error_of_the_vehicles(self) -> None:
        document = copy.deepcopy(flown().document)
        (own,) = document["compasses"]
        off = {**own["quoted"], "before": 170.0, "p95": 9.0}
        document["compasses"].append({**own, "compass": 2, "quoted": off})
        document["vehicle"]["compasses"] = [
            {"slot": slot, "device_id": 1, "external": True, "used": slot == 1} for slot in (1, 2)
        ]
        (line,) = pilots_lines(document)
        assert f"your compass is {words.degrees(own['quoted']['before'])} wrong" in line
        assert words.degrees(own["quoted"]["p95"]) in line
        for each in document["vehicle"]["compasses"]:
            each["used"] = False
        (line,) = pilots_lines(document)
        assert "your compasses are up to 170° wrong" in line

    def test_a_calibration_that_stays_is_left_as_it_is(self) -> None:
        (line,) = pilots_lines(changed(flown().document, 1, kept=True))
        assert line.endswith("Leave it as it is.")
        assert "Write" not in line

    def test_a_fit_no_better_than_what_is_in_force_is_not_urged(self) -> None:
        row = {**flown().document["compasses"][0]["quoted"], "before": 0.3, "p95": 0.9}
        (line,) = pilots_lines(changed(flown().document, 1, quoted=row))
        assert line.endswith("Leave it as it is.")

    def test_what_a_vehicle_that_stood_still_shows_is_written_though_its_bound_is_no_less(
        self,
    ) -> None:
        row = {**still().document["compasses"][0]["quoted"], "before": 5.0, "p95": 7.1}
        document = {**still().document, "compasses": still().document["compasses"][:1]}
        (line,) = pilots_lines(changed(document, 1, quoted=row))
        assert "your motors turn your compass by 5.0°. These numbers take that out. Write" in line
        unsure = [1.2 * abs(value) for value in document["compasses"][0]["interference_mgauss"]]
        (line,) = pilots_lines(changed(document, 1, quoted=row, std_mgauss=unsure))
        assert line.endswith("Leave it as it is.")

    def test_a_rejected_fit_says_why_and_never_write_them(self) -> None:
        (line,) = pilots_lines(refused().document)
        assert line.startswith("Do not write these numbers. ")
        assert "Write them" not in line
        assert len(line) > len("Do not write these numbers. ")

    def test_a_doubt_is_not_hidden(self) -> None:
        (line,) = pilots_lines(changed(flown().document, 1, verdict="marginal"))
        assert line.endswith("Write them, with the doubt below in mind.")

    def test_one_rejected_compass_of_three_has_a_line_of_its_own(self) -> None:
        lines = pilots_lines(changed(still().document, 2, verdict="rejected", reasons=["iron"]))
        assert len(lines) == 2
        assert "compasses 1 and 3 are" in lines[0]
        assert lines[1] == "Compass 2 gets no numbers. Iron."

    def test_a_fit_to_look_at_says_write_nothing(self) -> None:
        document = {**flown().document, "only_to_look_at": "the firmware cannot multiply it"}
        assert pilots_lines(document) == ("Write nothing: the firmware cannot multiply it.",)


class TestText:
    @pytest.mark.parametrize("make", [still, flown, refused])
    def test_the_pilot_s_line_comes_first(self, make) -> None:
        under_the_rule = text_of(make).splitlines()[1]
        assert pilots_lines(make().document)[0].startswith(under_the_rule.strip())

    def test_statistics_are_for_who_asks(self) -> None:
        for word in ("unexplained field", "straight to", "behind attitude"):
            assert word not in text_of(flown)
            assert word in text_of(flown, verbose=True)

    @pytest.mark.parametrize("make", [still, flown])
    def test_no_row_reads_as_worse(self, make) -> None:
        rows = re.findall(r"≤?(\d+\.\d)°.*?(\d+\.\d)°", text_of(make))
        assert rows
        assert all(float(now) >= float(bound) for now, bound in rows)

    def test_rows_that_were_not_flown_stand_in_brackets(self) -> None:
        coverage = flown().document["compasses"][0]["coverage"]
        for row in table_rows(flown().document["compasses"][0]):
            flown_there = words.is_flown(row["u"], coverage["u_low"], coverage["u_high"])
            label = words.quantity(row["u"], "current")
            assert (f"({label})" in text_of(flown).partition("heading error")[2]) != flown_there

    def test_axes_have_one_set_of_names(self) -> None:
        text = text_of(flown, verbose=True)
        assert text.count("forward") == 2
        assert not re.search(r"^ +x +y +z", text, re.MULTILINE)


class TestFirstStep:
    def test_it_is_about_the_compass_the_vehicle_flies_on(self) -> None:
        assert steps(still().document)[0] == "Your vehicle flies on compass 1: write its numbers."
        assert steps(still().document)[1].startswith("Disarm, then write")

    def test_a_rejected_compass_is_still_the_first_to_be_spoken_of(self) -> None:
        first = steps(changed(still().document, 1, verdict="rejected"))[0]
        assert first.startswith("Your vehicle flies on compass 1: switch it off and fly on")

    def test_the_first_that_is_used_is_flown_on(self) -> None:
        document = copy.deepcopy(still().document)
        document["vehicle"]["compasses"][0]["used"] = False
        assert steps(document)[0].startswith("Your vehicle flies on compass 2: ")

    def test_a_log_that_does_not_tell_which_is_used_begins_with_what_to_write(self) -> None:
        document = copy.deepcopy(still().document)
        for compass in document["vehicle"]["compasses"]:
            compass["used"] = None
        assert steps(document)[0].startswith("Disarm, then write")


class TestRoles:
    def test_the_first_used_compass_is_named(self) -> None:
        use = {role.compass: role.use for role in roles(still().document)}
        assert use[1] == "used first by the autopilot"
        assert use[2] == "used by the autopilot"

    def test_a_compass_that_is_not_used_is_named(self) -> None:
        document = copy.deepcopy(still().document)
        document["vehicle"]["compasses"][0]["used"] = False
        use = {role.compass: role.use for role in roles(document)}
        assert use[1] == "not used by the autopilot"
        assert use[2] == "used first by the autopilot"

    def test_a_rejected_first_compass_gives_up_its_place(self) -> None:
        document = changed(still().document, 1, verdict="rejected")
        assert "switch it off and fly on compasses 2 and 3" in actions(document)[1]
        assert "put compass 2 first" in actions(document)[1]
        assert actions(document)[2].startswith("write its numbers")

    def test_a_much_less_disturbed_compass_comes_first(self) -> None:
        document = changed(still().document, 3, interference_mgauss=[1.0, 1.0, 1.0])
        assert "put compass 3 first" in actions(document)[1]

    def test_a_kept_compass_is_kept(self) -> None:
        assert actions(changed(flown().document, 1, kept=True))[1].startswith("keep it as it is")

    def test_where_all_are_rejected_none_is_praised(self) -> None:
        document = copy.deepcopy(still().document)
        for compass in document["compasses"]:
            compass["verdict"] = Grade.REJECTED.value
        assert set(actions(document).values()) == {"mend what the verdict names"}
