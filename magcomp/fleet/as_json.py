"""A fleet as one JSON object. Keys are added, never renamed."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Any

from magcomp import __version__
from magcomp.fleet.aircraft import Aircraft
from magcomp.fleet.answer import Fleet
from magcomp.fleet.flights import Flight
from magcomp.fleet.history import CompassHistory
from magcomp.model import unit_of
from magcomp.report.as_json import SCHEMA


def fleet_object(fleet: Fleet) -> dict[str, Any]:
    """What ``magcomp fleet --json`` prints."""
    return {
        "magcomp": __version__,
        "schema": SCHEMA,
        "logs": fleet.logs,
        "read": fleet.read,
        "fitted": fleet.fitted,
        "copies": fleet.selected.copies,
        "aircraft": [_aircraft(each) for each in fleet.aircraft],
        "unusable": [
            {"log": each.path, "state": each.state, "reason": each.why} for each in fleet.unusable
        ],
    }


def _aircraft(each: Aircraft) -> dict[str, Any]:
    return {
        "name": each.name,
        "known_by": each.known_by,
        "uid": each.uid or None,
        "autopilot": each.autopilot,
        "kind": each.kind,
        "firmware": each.firmware,
        "device_ids": [int(one) for one in each.device_ids.split()],
        "logs": each.logs,
        "newest": moment(each.newest),
        "attention": each.attention.name.lower(),
        "findings": [
            {"attention": one.attention.name.lower(), "text": one.text} for one in each.findings
        ],
        "compasses": [_compass(one) for one in each.compasses],
        "unusable": [one.path for one in each.unusable],
    }


def _compass(history: CompassHistory) -> dict[str, Any]:
    pooled = history.pooled
    return {
        "compass": history.compass,
        "device_id": history.device_id,
        "regressor": history.regressor,
        "unit": unit_of(history.regressor),
        "in_force_holds": history.holds.name.lower(),
        "drift_deg": history.drift_deg,
        "pooled": None
        if pooled is None
        else {
            "interference_mgauss": -pooled.motor,
            "std_mgauss": [float(pooled.covariance[i, i]) ** 0.5 for i in range(3)],
            "scatter_mgauss": pooled.scatter,
            "scatter_deg": history.scatter_deg,
            "flights": pooled.count,
            "agree": history.agree,
        },
        "apart": [{"log": history.flights[i].path, "why": text} for i, text in history.apart],
        "flights": [_flight(one) for one in history.flights],
    }


def _flight(flight: Flight) -> dict[str, Any]:
    return {
        "log": flight.path,
        "digest": flight.digest,
        "start": moment(flight.start_unix_s),
        "verdict": flight.verdict,
        "reasons": flight.reasons.splitlines(),
        "before_deg": flight.before_deg,
        "bound_deg": flight.bound_deg,
        "interference_mgauss": -flight.correction[:3],
    }


def moment(unix_s: float) -> str | None:
    """A moment, UTC, as ISO 8601; None where it is unknown or none."""
    if not math.isfinite(unix_s):
        return None
    try:
        return datetime.fromtimestamp(unix_s, UTC).isoformat(timespec="seconds")
    except (OverflowError, ValueError, OSError):
        return None
