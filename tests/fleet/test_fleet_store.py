"""The dataset: what goes in comes out, a killed run goes on, nothing is read twice."""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_flights import log, row
from pyarrow import parquet

from magcomp.errors import OutputError
from magcomp.fleet.as_table import cell, csv_text, write_table
from magcomp.fleet.flights import select
from magcomp.fleet.row import COLUMNS, Log, Row, State, without_fit
from magcomp.fleet.run import carry_out_all, known_of, lost, to_do
from magcomp.fleet.store import Store, table_of
from magcomp.fleet.task import Outcome, Task

CLOCK = itertools.count().__next__


def fitted(tasks: Iterable[Task]) -> Iterator[Outcome]:
    """A runner that fits nothing, and knows the log's content by its size."""
    for task in tasks:
        digest = f"{task.log.size:064x}"
        if digest in task.known:
            yield Outcome(task.log, digest, without_fit(task.log, digest, "", state=State.COPY))
            continue
        of = task.log
        made = replace(row(0), path=of.path, size=of.size, stamp=of.stamp, digest=digest)
        yield Outcome(of, digest, (made,))


def run(logs: list[Log], store: Store, *, again: bool = False) -> Iterator[Outcome]:
    known = known_of(store)
    return carry_out_all(to_do(logs, known, again=again), known, store, fitted, CLOCK)


def test_rows_come_back_as_they_went_in(tmp_path: Path) -> None:
    rows = [row(0), *without_fit(log(1), "", "why\nnot")]
    store = Store(tmp_path)
    store.append(rows)
    back = store.read().to_pylist()
    assert list(back[0]) == list(COLUMNS)
    for made, found in zip(rows, back, strict=True):
        for name in COLUMNS:
            value = getattr(made, name)
            np.testing.assert_equal(
                found[name], list(value) if isinstance(value, tuple) else value, err_msg=name
            )


def test_a_run_that_ends_half_way_goes_on(tmp_path: Path) -> None:
    logs = [log(k) for k in range(10)]
    ended = run(logs, Store(tmp_path))
    first = [next(ended).log for _ in range(4)]
    ended.close()  # type: ignore[attr-defined]
    rest = [outcome.log for outcome in run(logs, Store(tmp_path))]
    assert len(first) + len(rest) == 10
    assert set(first).isdisjoint(rest)
    assert not list(run(logs, Store(tmp_path)))


def test_a_log_that_changed_is_read_again(tmp_path: Path) -> None:
    store = Store(tmp_path)
    list(run([log(0), log(1)], store))
    changed = replace(log(1), stamp="later", size=77)
    assert [outcome.log for outcome in run([log(0), changed], store)] == [changed]


def test_a_log_whose_place_gives_no_stamp_is_read_again(tmp_path: Path) -> None:
    store = Store(tmp_path)
    unstamped = replace(log(0), stamp="")
    for _ in range(2):
        assert len(list(run([unstamped], store))) == 1


def test_a_copy_is_not_fitted(tmp_path: Path) -> None:
    store = Store(tmp_path)
    copy = replace(log(0), path="copy.tlog")
    list(run([log(0)], store))
    (outcome,) = run([log(0), copy], store)
    assert outcome.rows[0].state == State.COPY
    within = replace(log(3), path="zz.tlog")
    states = [o.rows[0].state for o in run([log(3), within], Store(tmp_path / "other"))]
    assert states == [State.FITTED, State.COPY]


def test_another_version_fits_anew(tmp_path: Path) -> None:
    list(run([log(0)], Store(tmp_path, "0.1.0")))
    assert len(list(run([log(0)], Store(tmp_path, "0.2.0")))) == 1


def test_a_lost_log_is_tried_again_only_when_asked(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.append(lost(Task(log(0)), "it died").rows)
    assert not list(run([log(0)], store))
    assert select(store.read(), [log(0)], known_of(store)).unusable[0].why == "it died"
    assert len(list(run([log(0)], store, again=True))) == 1
    found = select(store.read(), [log(0)], known_of(store))
    assert (len(found.flights), len(found.unusable)) == (1, 0)
    assert not list(run([log(0)], store, again=True))


def test_many_small_files_become_one(tmp_path: Path) -> None:
    store = Store(tmp_path)
    for k in range(20):
        store.append([row(k)])
    before = store.read().sort_by("path").to_pylist()
    store.gather()
    assert len(list(store.folder.iterdir())) == 1
    np.testing.assert_equal(store.read().sort_by("path").to_pylist(), before)


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    store = Store(tmp_path)
    (store.folder / "x.parquet").write_bytes(b"no parquet at all")
    with pytest.raises(OutputError, match=r"x\.parquet must be a file of results"):
        store.read()


@given(st.text())
def test_no_cell_is_a_formula(text: str) -> None:
    written = str(cell(text))
    assert written.isprintable()
    assert not written.lstrip().startswith(("=", "+", "-", "@"))


def test_a_file_that_lacks_a_column_is_named(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.append([row(0)])
    (part,) = store.folder.glob("*.parquet")
    parquet.write_table(parquet.read_table(part).drop_columns(["digest"]), part)
    with pytest.raises(OutputError, match=f"{part.name} must be a file of results.*digest"):
        store.read()


def test_texts_that_are_shared_are_those_that_were_written(tmp_path: Path) -> None:
    store = Store(tmp_path)
    # A file each, so that each has a dictionary of its own.
    for number in range(3):
        store.append([row(number, verdict=f"verdict {number % 2}"), row(number, compass=2)])
    whole = store.read().select(["verdict", "compass", "path"]).to_pylist()
    assert store.read(["verdict", "compass", "path"]).to_pylist() == whole
    assert sorted(each["verdict"] for each in whole)[-2:] == ["verdict 0", "verdict 1"]


def test_a_spreadsheet_has_a_column_a_number(tmp_path: Path) -> None:
    made: Row = row(0, reasons='=HYPERLINK("http://x")\nsecond', before_deg=float("nan"))
    (found,) = csv.DictReader(io.StringIO(csv_text(table_of([made]))))
    assert float(found["correction_motor_z"]) == made.correction[2]
    assert float(found["motor_covariance_xx"]) == made.motor_covariance[0]
    assert found["reasons"].startswith("'=HYPERLINK")
    assert found["before_deg"] == ""
    target = tmp_path / "t.csv"
    write_table(target, table_of([made]))
    with pytest.raises(OutputError, match="--force"):
        write_table(target, table_of([made]))
