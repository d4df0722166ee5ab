"""A machine in inches: HAL's numbers are in its unit, the daemon's in um."""

import contextlib
import os

from lab import eventually
from warm_mill import AXES, FOLLOWS_um, STEADY, WarmMill, expected_um, largest

WAY = os.environ["THERMOCOMP_WAY"]
PLACE_mm = {"x": 20.0, "y": 20.0, "z": -20.0}


def test_offsets_are_micrometres_on_a_machine_in_inches():
    with contextlib.closing(WarmMill(WAY, STEADY, 4000, 40.0, 1.0, unit_mm=25.4)) as mill:
        mill.daemon.start()
        mill.cnc.start()
        mill.cnc.on()
        mill.cnc.home()
        eventually(lambda: (mill.daemon.axis("x")["displacement"] or 0.0) < -29.9, "a warm machine")
        mill.in_step()
        errors, axes = mill.errors_um(**PLACE_mm)
        assert largest(errors) <= FOLLOWS_um, errors
        for a in AXES:
            assert abs(axes[a]["applied"] - expected_um(a)) < 1.0, axes[a]
        signals = mill.daemon.status()["controller"]["signals"]
        assert abs(signals["x_mm"] - PLACE_mm["x"]) < 0.001
