"""What is said of the forms that the field may follow."""

from __future__ import annotations

import math

from magcomp.analysis.forms import forms_notes
from magcomp.model import CURRENT, Form


def test_where_no_form_is_the_best_nothing_is_said_of_them() -> None:
    """Hostile values leave every form with nothing that could be told."""
    untold = Form(CURRENT, 3, math.nan, math.nan, is_best=False)
    assert [*forms_notes({1: (untold,), 2: ()}, {}, CURRENT)] == []
