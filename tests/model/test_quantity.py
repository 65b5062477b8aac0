"""Control quantities, and corrections of several parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import magcomp
from magcomp.model import CURRENT, THROTTLE, Correction, pack, quantity_of, unpack

rng = np.random.default_rng(1)
SHAPE = np.eye(3) + 0.05 * np.array([[1.0, 0.3, 0.2], [0.3, -1.0, 0.4], [0.2, 0.4, 0.5]])


def of_parts(parts: int) -> Correction:
    return Correction(rng.normal(size=3), SHAPE, rng.normal(size=(3, parts)))


@pytest.mark.parametrize("parts", [1, 4, 8])
def test_a_correction_undoes_what_it_applies_whatever_its_parts(parts):
    made, raw, u = of_parts(parts), rng.normal(size=(9, 3)), rng.uniform(size=(9, parts))
    assert np.allclose(made.undo(made.apply(raw, u), u), raw)


@pytest.mark.parametrize("parts", [1, 4, 8])
def test_a_correction_survives_its_parameters(parts):
    made = of_parts(parts)
    again = unpack(pack(made))
    assert np.array_equal(again.motor, made.motor)
    assert np.array_equal(again.offset, made.offset)
    assert np.array_equal(again.soft_iron, made.soft_iron)


def test_a_total_is_shared_alike_by_all_parts():
    made, raw, total = of_parts(4), rng.normal(size=(5, 3)), rng.uniform(size=5)
    alike = np.repeat(total[:, None] / 4, 4, axis=1)
    assert np.allclose(made.apply(raw, total), made.apply(raw, alike))
    centre = made.apply(made.centre(2.0)[None], np.full((1, 4), 0.5))
    assert np.allclose(centre, 0.0)


def test_words_and_tables_follow_the_quantity():
    assert quantity_of(CURRENT).rows(62.0)[-1] == 60.0
    assert quantity_of(THROTTLE).rows(62.0)[-1] == 1.0
    assert quantity_of(None) is quantity_of(CURRENT)
    assert quantity_of(THROTTLE).of(current=1, throttle=2) == 2


def test_no_other_module_tells_quantities_apart_by_name():
    root = Path(magcomp.__file__).parent
    found = [
        f"{path.relative_to(root)}: {line.strip()}"
        for path in sorted(root.rglob("*.py"))
        for line in path.read_text(encoding="utf-8").splitlines()
        if any(
            f"{sign} {name}" in line for sign in ("==", "!=") for name in ("CURRENT", "THROTTLE")
        )
    ]
    assert found == []
