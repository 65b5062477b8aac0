"""``magcomp upload`` killed with SIGKILL at a message: no half of a calibration is ever in force.

By default half a dozen messages spread over the whole sequence; MAGCOMP_EVERY=1 in the
environment takes them all, one by one.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading

import pytest
from live_vehicle import COMPENSATION, alive, held, landed

from magcomp.cli.app import run
from magcomp.live.upload import read_backup
from magcomp.mavlink.header import message_id
from magcomp.model import ParameterSet
from magcomp.simulate.faults import WRITING
from magcomp.writing.events import Standing
from magcomp.writing.files import write_parameter_file
from magcomp.writing.journal import read_journal

MESSAGES = 290
"""Parameter messages, both ways, of one whole upload; a test below proves that it is enough."""

EVERY = int(os.environ.get("MAGCOMP_EVERY", "100"))
OLD_MOTOR = {f"COMPASS_MOT{n}_{axis}": 0.75 for n in ("", "2", "3") for axis in "XYZ"}
PATIENCE_S = 60.0


class KillAt:
    """A vehicle that kills a process at a counted message, and looks at itself all the time."""

    def __init__(self, vehicle, at, victim):
        self._vehicle, self._at, self._victim = vehicle, at, victim
        self._old = held(vehicle)
        self.counted = 0
        self.exceptions = []

    def receive(self, frame, time):
        self._count(frame)
        self._vehicle.receive(frame, time)
        now = held(self._vehicle)
        if now not in (self._old, COMPENSATION) and now["COMPASS_MOTCT"] != 0:
            self.exceptions.append(now)

    def advance(self, time):
        frames = self._vehicle.advance(time)
        for frame in frames:
            self._count(frame.data)
        return frames

    def _count(self, frame):
        if message_id(frame) in WRITING:
            self.counted += 1
            if self.counted == self._at:
                self._victim.kill()


class Victim:
    """A process to be, and then to be killed."""

    def __init__(self):
        self._process = None
        self._started = threading.Event()

    def run(self, *arguments):
        self._process = subprocess.Popen(
            [sys.executable, "-m", "magcomp", *arguments],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        self._started.set()
        _, said = self._process.communicate(timeout=PATIENCE_S)
        return self._process.returncode, said.decode()

    def kill(self):
        self._started.wait(PATIENCE_S)
        self._process.send_signal(signal.SIGKILL)


def upload_killed(at, tmp_path):
    """Upload and be killed; then restore. Gives exit code, machine, and old and present values."""
    victim, machines = Victim(), []

    def wrap(vehicle):
        machines.append(KillAt(vehicle, at, victim))
        return machines[0]

    file, backup = tmp_path / "new.param", tmp_path / "old.param"
    parameters = {"COMPASS_MOTCT": 2.0, **OLD_MOTOR}
    with alive(vehicle=landed(parameters=parameters), wrap=wrap) as flown:
        old = held(flown.vehicle)
        write_parameter_file(file, ParameterSet(COMPENSATION))
        options = ("--yes", "--any-vehicle", "--system", "1")
        code, said = victim.run(
            "upload", str(file), flown.address, "--backup", str(backup), *options
        )
        stands = held(flown.vehicle)
        if backup.exists():
            _, journal = read_backup(backup)
            assert run(["restore", str(backup), flown.address, *options]) == 0
            assert read_journal(backup).restored
        else:
            journal = None
        return code, said, machines[0], old, stands, journal, held(flown.vehicle)


@pytest.mark.parametrize("at", range(1, MESSAGES, EVERY))
def test_killed_at_any_message_the_vehicle_is_whole_and_restore_brings_all_old_back(at, tmp_path):
    code, _, machine, old, stands, journal, restored = upload_killed(at, tmp_path)
    assert code == -signal.SIGKILL
    assert machine.exceptions == []
    assert stands in (old, COMPENSATION) or stands["COMPASS_MOTCT"] == 0
    assert restored == old
    match journal.standing if journal else Standing.OLD:
        case Standing.OLD:
            assert stands == old
        case Standing.NEW:
            assert stands == COMPENSATION
        case Standing.OFF:
            assert stands["COMPASS_MOTCT"] == 0


def test_the_messages_above_are_the_whole_sequence(tmp_path):
    code, said, machine, _, stands, journal, _ = upload_killed(-1, tmp_path)
    assert code == 0, said
    assert stands == COMPENSATION
    assert journal.standing is Standing.NEW
    # What is counted after the upload is the restore; nothing before it may be left out.
    assert machine.counted >= MESSAGES
