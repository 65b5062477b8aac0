"""How every screen looks at 80×24 and 120×40.

The words are compared always. The pictures, with colours, are compared where Textual is the one
they were made with: another release may draw a border differently and be right. Both are made
anew by ``pytest tests/tui/test_tui_screens.py --snapshot-update``.
"""

from __future__ import annotations

import pytest
import scripted
import staged
from pytest_textual_snapshot import SVGImageExtension
from syrupy.extensions.single_file import SingleFileSnapshotExtension, WriteMode
from textual import __version__ as textual_version

from magcomp.tui.widgets.key_bar import KeyBar
from magcomp.tui.widgets.next_line import NextLine

MADE_WITH = "8.2.8"


class Words(SingleFileSnapshotExtension):
    file_extension = "txt"
    _file_extension = "txt"
    _write_mode = WriteMode.TEXT


@pytest.mark.parametrize("stage", staged.STAGES, ids=lambda stage: stage.__name__)
async def test_screen(stage, tmp_path, snapshot):
    app = staged.app(tmp_path)
    async with app.run_test(size=staged.SIZES[0]) as pilot:
        await stage(pilot)
        for size in staged.SIZES:
            await pilot.resize_terminal(*size)
            await scripted.steady(pilot)
            named = "x".join(map(str, size))
            shown = scripted.picture(app)
            assert shown == snapshot(name=named, extension_class=Words)
            assert len(shown.splitlines()) <= size[1]
            assert max(map(len, shown.splitlines())) <= size[0]
            drawn = app.export_screenshot(title=app.title, simplify=True)
            same = drawn == snapshot(name=named, extension_class=SVGImageExtension)
            assert same or textual_version != MADE_WITH


@pytest.mark.parametrize("size", [(60, 20), (200, 60)], ids=["60x20", "200x60"])
@pytest.mark.parametrize(
    "stage",
    [staged.record, staged.fit_fits, staged.review_written, staged.verify_measured],
    ids=lambda stage: stage.__name__,
)
async def test_nothing_is_cut_off_at_the_smallest_and_the_largest_terminal(stage, size, tmp_path):
    app = staged.app(tmp_path)
    async with app.run_test(size=size) as pilot:
        await stage(pilot)
        await scripted.steady(pilot)
        step = app.screen
        foot = step.query_one(NextLine).region.y
        assert step.query_one(KeyBar).region.bottom == size[1]
        for panel in step.query(".panel, .view, #changes, #facts, #held-now, #place"):
            if panel.region.area:
                assert panel.region.bottom <= foot
                assert panel.region.right <= size[0]
        shown = scripted.picture(app)
        for keys in (
            b.description for _, b, on, _ in step.active_bindings.values() if on and b.show
        ):
            assert keys in shown


@pytest.mark.parametrize(
    "stage", [staged.fit_heading, staged.verify_moved], ids=lambda stage: stage.__name__
)
async def test_a_picture_depends_only_on_data_and_size(stage, tmp_path):
    """However the room came about: a terminal that grew looks like one that was large."""
    small, large = staged.SIZES

    async def grown(first) -> str:
        app = staged.app(tmp_path)
        async with app.run_test(size=first) as pilot:
            await stage(pilot)
            await pilot.resize_terminal(*large)
            await scripted.steady(pilot)
            return scripted.picture(app)

    assert await grown(small) == await grown(large)
