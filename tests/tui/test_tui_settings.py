"""What a pilot sets: keys, theme, folder; what is remembered; what a bad file says."""

from __future__ import annotations

import contextlib

import made
import pytest
import scripted
from hypothesis import given
from hypothesis import strategies as st
from scripted import press, screen, until

from magcomp.errors import UsageError
from magcomp.tui.screens.dialogs import Help
from magcomp.tui.settings import (
    MOST_RECENT,
    Remembered,
    Settings,
    read_remembered,
    read_settings,
    write_remembered,
    write_template,
)


def settings(folder, text: str) -> Settings:
    (folder / "settings.toml").write_text(text, encoding="utf-8")
    return read_settings(folder)


def test_without_a_file_everything_is_as_usual(tmp_path):
    assert read_settings(tmp_path / "nowhere").keys == {}


def test_a_file_sets_theme_folder_and_keys(tmp_path):
    read = settings(
        tmp_path, 'theme = "sun"\nfolder = "/flights"\n[keys]\n"fit.method" = "f7"\nfit.time = "z"'
    )
    assert read.theme == "sun"
    assert str(read.folder) == "/flights"
    assert read.keys == {"fit.method": "f7", "fit.time": "z"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("theme = sun", "must be TOML"),
        ("theme = 3", "theme must be a text in quotes; instead received 3"),
        ("colour = 'red'", "must hold only theme, folder and keys; instead received colour"),
        ("[keys]\n'fit.method' = 7", "the key of fit.method must be a text"),
        ("keys = 3", "keys must be a table"),
    ],
)
def test_a_bad_file_is_refused_with_its_name(tmp_path, text, says):
    with pytest.raises(UsageError, match=r"settings\.toml") as refused:
        settings(tmp_path, text)
    assert says in str(refused.value)


@given(text=st.text())
def test_no_text_does_more_than_be_refused(tmp_path_factory, text):
    folder = tmp_path_factory.mktemp("settings")
    (folder / "settings.toml").write_bytes(text.encode("utf-8", "surrogatepass"))
    with contextlib.suppress(UsageError):
        assert isinstance(read_settings(folder), Settings)


@given(content=st.binary())
def test_a_damaged_state_file_is_left_out_of_account(tmp_path_factory, content):
    folder = tmp_path_factory.mktemp("state")
    (folder / "state.json").write_bytes(content)
    assert isinstance(read_remembered(folder), Remembered)


def test_what_was_used_lately_is_remembered_the_latest_first(tmp_path):
    remembered = Remembered(theme="sun")
    for number in range(10):
        remembered = remembered.with_recent(f"udp:0.0.0.0:{number}")
    remembered = remembered.with_recent("udp:0.0.0.0:7")
    write_remembered(tmp_path, remembered)
    read = read_remembered(tmp_path)
    assert read == remembered
    assert read.recent[:3] == ("udp:0.0.0.0:7", "udp:0.0.0.0:9", "udp:0.0.0.0:8")
    assert len(read.recent) == MOST_RECENT


def test_the_template_is_a_good_file_and_never_overwrites(tmp_path):
    path = write_template(tmp_path)
    assert read_settings(tmp_path) == Settings(source=path)
    path.write_text("theme = 'sun'\n")
    write_template(tmp_path)
    assert read_settings(tmp_path).theme == "sun"


def test_a_key_of_an_unknown_action_is_refused(tmp_path):
    with pytest.raises(UsageError, match=r"instead received fit\.methood"):
        scripted.app(tmp_path, settings=Settings(keys={"fit.methood": "m"}))


def test_an_unknown_theme_is_refused_with_those_there_are(tmp_path):
    with pytest.raises(UsageError, match="sun"):
        scripted.app(tmp_path, settings=Settings(theme="noon"))


async def test_every_action_with_a_key_can_be_given_another(tmp_path):
    app = scripted.app(tmp_path, settings=Settings(keys={"fit.view": "f7", "app.light": "f8"}))
    async with app.run_test() as pilot:
        await until(pilot, lambda: app.choices)
        await press(pilot, "l")
        assert app.theme == "night"
        await press(pilot, "f8")
        assert app.theme == "sun"
        app.set_work(made.work())
        app.action_go("fit")
        await until(pilot, lambda: "Heading error" in screen(app))
        assert "f7 View" in screen(app)
        await press(pilot, "f7")
        await until(pilot, lambda: "Field the motors add" in screen(app))


async def test_the_theme_chosen_is_there_the_next_time(tmp_path):
    async with scripted.app(tmp_path).run_test() as pilot:
        await press(pilot, "l")
    assert scripted.app(tmp_path).theme == "sun"


async def test_f1_helps_with_what_has_the_focus_and_names_the_keys(tmp_path):
    app = scripted.app(tmp_path)
    async with app.run_test() as pilot:
        await until(pilot, lambda: app.choices)
        await press(pilot, "f1")
        await until(pilot, lambda: isinstance(app.screen, Help))
        assert "Choose with the arrow keys" in screen(app)
        await press(pilot, "escape", "a", "f1")
        await until(pilot, lambda: "Type where the vehicle is" in screen(app))
        await press(pilot, "escape", "escape", "f1", "end")
        await until(pilot, lambda: "connect.simulate" in screen(app))


async def test_the_palette_has_every_step_and_every_deed(tmp_path):
    app = scripted.app(tmp_path)
    async with app.run_test():
        titles = {command.title for command in app.get_system_commands(app.screen)}
        for deed in ("Open a log", "Go to Verify", "Write to vehicle", "Undo writing", "Quit"):
            assert deed in titles
        assert any("theme" in title.lower() for title in titles)


async def test_a_step_that_cannot_be_taken_says_what_is_missing(tmp_path):
    app = scripted.app(tmp_path)
    async with app.run_test(notifications=True) as pilot:
        app.action_go("record")
        assert app.current_mode == "connect"
        await until(pilot, lambda: app.screen.query("Toast"))
        (toast,) = app.screen.query("Toast")
        assert "Connect to a vehicle or open a log first." in str(toast.render())


async def test_a_key_in_the_bottom_line_can_be_clicked(tmp_path):
    app = scripted.app(tmp_path)
    async with app.run_test() as pilot:
        await until(pilot, lambda: "l Light" in screen(app))
        column = scripted.picture(app).splitlines()[-1].index("Light")
        await pilot.click(offset=(column, 23))
        await until(pilot, lambda: app.theme == "sun")
