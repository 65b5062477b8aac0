"""A field that bends with the current is shown beside the straight line that is written."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from report_analyses import flown

from magcomp.model import Analysis, Form
from magcomp.report.as_text import evidence, render
from magcomp.report.bend import bend_of
from magcomp.report.figure import quantity_of
from magcomp.report.figures import shift
from magcomp.report.look import Look

CURVE = ((1.0, 0.0, 0.0), (2.0, -1.0, 0.5), (0.05, 0.0, 0.0))


def bent(*, is_best: bool = True) -> Analysis:
    plain = flown().analysis
    forms = (
        Form("current", 3, 4.0, 1.5, is_best=not is_best),
        Form("curved current", 6, 3.0, np.nan, is_best=is_best, curve=CURVE),
    )
    first = replace(plain.compasses[0], forms=forms)
    return replace(plain, compasses=(first,))


def test_the_curve_is_what_its_three_vectors_say_and_the_line_is_what_is_written():
    (result,) = bent().compasses
    bend = bend_of(result)
    assert bend is not None
    assert bend.u[-1] == result.fit.u_high
    np.testing.assert_allclose(bend.curve[0], CURVE[0])
    top = result.fit.u_high
    np.testing.assert_allclose(bend.curve[-1], [1.0 + 2.0 * top + 0.05 * top**2, -top, 0.5 * top])
    np.testing.assert_allclose(bend.straight[-1], top * result.fit.interference)


def test_the_page_draws_it_and_the_text_has_it_in_few_lines():
    analysis = bent()
    (result,) = analysis.compasses
    dotted = [t for t in shift(result, quantity_of("current")).data if "bent" in t.get("name", "")]
    assert [trace["name"] for trace in dotted] == ["forward, bent", "right, bent", "down, bent"]
    top = result.fit.u_high
    np.testing.assert_allclose(dotted[0]["y"][-1], 1.0 + 2.0 * top + 0.05 * top**2, atol=0.01)
    shown = render([*evidence(analysis, verbose=True)], Look(columns=70))
    assert "straight, mGauss" in shown
    assert max(map(len, shown.splitlines())) <= 70
    assert "straight, mGauss" not in render([*evidence(analysis, verbose=False)], Look(columns=70))


def test_a_straight_field_has_no_curve():
    (result,) = bent(is_best=False).compasses
    assert bend_of(result) is None
    assert "bent" not in str(shift(result, quantity_of("current")).data)
