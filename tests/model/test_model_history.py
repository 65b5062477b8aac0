"""Parameters against time: the definition, whatever the number of changes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from magcomp.model import ParameterChange, ParameterHistory

changes = st.lists(
    st.builds(
        ParameterChange,
        st.integers(-5, 20).map(float),
        st.sampled_from(["A", "B"]),
        st.floats(-1e3, 1e3),
    ),
    max_size=12,
)
times = st.one_of(
    st.integers(-10, 30).map(lambda half: half / 2), st.sampled_from([np.inf, -np.inf])
)


@given(changes, times)
def test_a_value_holds_from_its_report_and_the_first_before_it_too(
    made: list[ParameterChange], time: float
) -> None:
    history = ParameterHistory(tuple(made))
    for name in ("A", "B"):
        reports = sorted((change for change in made if change.name == name), key=lambda c: c.time)
        assert history.of(name) == tuple(reports)
        expected = -1.0
        for index, report in enumerate(reports):
            if index == 0 or report.time <= time:
                expected = report.value
        assert history.at(name, time, -1.0) == expected
        assert history.last(name, -1.0) == (reports[-1].value if reports else -1.0)


class Counting(float):
    """A time that counts how often it is compared."""

    compared = 0

    def __lt__(self, other: object) -> bool:
        Counting.compared += 1
        return float(self) < float(other)  # type: ignore[arg-type]

    __hash__ = float.__hash__


def test_a_value_among_many_is_found_without_looking_at_all() -> None:
    many = tuple(ParameterChange(Counting(n), "A", n) for n in range(1 << 14))
    history = ParameterHistory(many)
    Counting.compared = 0
    assert history.at("A", Counting(9000.5), 0.0) == 9000
    assert Counting.compared < 40
