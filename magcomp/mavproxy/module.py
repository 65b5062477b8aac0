"""What MAVProxy loads. Nothing here works without MAVProxy, and nothing elsewhere with it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from magcomp.analysis import Options
from magcomp.buffer import Buffer
from magcomp.link import DEFAULT_RATES, Connection, Recorder
from magcomp.link.address import Carried
from magcomp.link.clock import SystemClock
from magcomp.live.latest import Latest
from magcomp.live.session import LiveSession
from magcomp.live.tap import Tap
from magcomp.live.upload import new_file
from magcomp.mavproxy.carried import CarriedTransport
from magcomp.mavproxy.commands import Commands

_NAME = "mavproxy"


def load(mpstate: Any) -> Any:
    """Make the module of a running MAVProxy.

    Parameters
    ----------
    mpstate
        MAVProxy's state, as it gives it to each module's ``init``.

    Returns
    -------
    MPModule
        What MAVProxy keeps in its list of modules.

    Raises
    ------
    OutputError
        The recording cannot be made.
    """
    from MAVProxy.modules.lib.mp_module import MPModule  # noqa: PLC0415 - there if this is called

    clock = SystemClock()
    transport = CarriedTransport(lambda data: mpstate.master().write(data), clock)
    commands = Commands(_session(transport, clock, mpstate.settings.target_system or None))

    class MagcompModule(MPModule):  # type: ignore[misc] # untyped
        """Hands frames and words on."""

        def __init__(self) -> None:
            super().__init__(mpstate, "magcomp", "what the motors do to the compass, and the cure")
            words = ["status", "fit", "write (yes)", "undo (yes)"]
            self.add_command("magcomp", self.said, "compass motor compensation", words)
            self._leaving = False

        def mavlink_packet(self, packet: Any) -> None:
            """Called by MAVProxy for each message."""
            if packet.get_type() != "BAD_DATA":
                transport.put(bytes(packet.get_msgbuf()))

        def said(self, words: Sequence[str]) -> None:
            """Called by MAVProxy for what is typed after `magcomp`."""
            commands.run(words)

        def unload(self) -> None:
            """Called by MAVProxy before it forgets the module."""
            mpstate.command_map.pop("magcomp", None)
            if commands.stop():
                commands.close()
                return
            # MAVProxy waits for this and hears nothing meanwhile, but a write is put back by
            # hearing the vehicle: so stay on its list until that has ended.
            self._leaving = True
            self.needs_unloading = False
            mpstate.modules.append((self, None))

        def idle_task(self) -> None:
            """Called by MAVProxy again and again."""
            if self._leaving and commands.stop():
                self.needs_unloading = True

    return MagcompModule()


def _session(transport: CarriedTransport, clock: SystemClock, system: int | None) -> LiveSession:
    """A session that records from now on. No refits: they would take MAVProxy's own time."""
    record = new_file("recording", ".tlog", None, time.time())
    tap = Tap(Buffer(str(record)), Latest(), Recorder(record, force=False))
    connection = Connection(Carried(_NAME), lambda: transport, system=system, sinks=[tap])
    return LiveSession(
        connection,
        tap,
        clock=clock,
        rates=DEFAULT_RATES,
        options=Options(),
        refit_share=0.0,
    )
