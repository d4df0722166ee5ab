"""A G-code program moves all axes while the machine warms: the drives follow position plus wanted
offset smoothly; when the data are lost during the program, the offsets are held."""

import contextlib
import os
import time

import numpy as np
import pytest

from lab import eventually
from recording import SMOOTH, recording
from warm_mill import AXES, FOLLOWS_um, SWINGING, WarmMill

WAY = os.environ["THERMOCOMP_WAY"]
# Slow and tolerant: delays of the bridge on a busy computer must not look like a mismatch.
RATE_um_per_s = 5.0
SILENT_AFTER_s = 4.0
START = "X50 Y50 Z-20"
PROGRAM = f"""G21 G90 G94 G17 G61
G53 G0 {START}
M3 S6000
o100 repeat [{{rounds}}]
  G1 X100 Y80 Z-40 F5000
  G4 P0.1
  G2 X100 Y20 I0 J-30
  G1 X50 Y50 Z-20
  G0 X20 Y20 Z-10
o100 endrepeat
G0 {START}
M5
M2
"""
CORNERS_mm = ([20.0, 20.0, -40.0], [130.0, 80.0, -10.0])  # minimum and maximum per axis


@pytest.fixture(scope="module")
def mill():
    """One machine for all tests in order; the last test disturbs it."""
    with contextlib.closing(WarmMill(WAY, SWINGING, 25, RATE_um_per_s, SILENT_AFTER_s)) as made:
        made.daemon.start()
        made.cnc.start()
        made.cnc.on()
        made.cnc.home()
        made.in_step()
        yield made


def start_program(mill, rounds):
    (mill.cnc.folder / "program.ngc").write_text(PROGRAM.format(rounds=rounds))
    mill.cnc.run("/mnt/program.ngc")


def test_the_drives_follow_while_a_program_moves_all_axes(mill):
    mill.cnc.mdi("G53 G0 " + START)
    apart_um = []
    cut = set()
    with recording(mill.cnc) as made:
        start_program(mill, 1)
        while mill.cnc.running():
            status = mill.daemon.status()
            cut.add(status["controller"]["signals"]["cutting_on"])
            if status["mode"] == "compensating":
                apart_um += [abs(a["offset"] - a["applied"]) for a in status["axes"]]
            time.sleep(0.05)
    seen = made[0]
    print(f"\n{WAY}: while a program moves all axes, {len(seen.enabled)} servo periods")
    print(f"follow_error_um {seen.follow_error_um():.4f} at the drives, against what is asked for")
    print(f"daemon_apart_um {max(apart_um):.4f} as the daemon sees it, wanted against applied")
    print(f"offset_change_um {np.ptp(seen.asked_um, axis=0).max():.2f} meanwhile")
    print(f"step_um_per_ms {seen.largest_step_um():.5f}")
    print(f"acceleration_mm_per_s2 {seen.largest_acceleration_mm_per_s2():.4f}")
    assert len(apart_um) > 10
    assert np.ptp(seen.position_mm, axis=0).min() > 25  # the axes moved
    assert np.ptp(seen.asked_um, axis=0).max() > 0.5  # and the offsets changed
    assert seen.follow_error_um() <= FOLLOWS_um
    assert max(apart_um) <= FOLLOWS_um
    assert SMOOTH[WAY].holds(seen)
    # LinuxCNC's commands equal the program to a nanometre.
    end_mm = mill.cnc.pins(*(f"axis.{a}.pos-cmd" for a in AXES))
    assert np.allclose(end_mm, [50.0, 50.0, -20.0], rtol=0, atol=1e-6)
    low, high = CORNERS_mm
    assert np.allclose(seen.position_mm.min(axis=0), low, rtol=0, atol=1e-6)
    assert np.allclose(seen.position_mm.max(axis=0), high, rtol=0, atol=1e-3)  # top of the arc
    assert 1.0 in cut


def signals_true(mill, name):
    return mill.cnc.halcmd("gets", name)[1].strip() == "TRUE"


def test_lost_data_in_mid_program_hold_the_offset_and_warn(mill):
    start_program(mill, 1000)
    eventually(lambda: abs(mill.daemon.axis("x")["offset"]) > 3.0, "an offset to lose")
    eventually(lambda: not signals_true(mill, "tc-warning"), "no warning before it")
    mill.cnc.messages()

    mill.simulator.kill()  # no thermocouple answers
    status = mill.daemon.wait_for_mode("holding")
    held_um = [a["offset"] for a in status["axes"]]
    eventually(lambda: signals_true(mill, "tc-warning"), "the warning, of the daemon's mode")
    with recording(mill.cnc) as held:
        time.sleep(1.0)
    mill.daemon.kill()
    eventually(lambda: not signals_true(mill, "tc-fresh"), "the offsets are not fresh")
    assert signals_true(mill, "tc-warning")
    with recording(mill.cnc) as alone:
        time.sleep(1.0)
    assert mill.cnc.running()
    for seen in held + alone:
        assert np.ptp(seen.position_mm, axis=0).max() > 1.0  # during the program
        assert np.abs(seen.applied_um - held_um).max() <= 0.1
    print(f"\n{WAY}: without thermocouples, then without the daemon, the drives keep their offsets"
          f" within {max(np.abs(s.applied_um - held_um).max() for s in held + alone):.3f} um")
    output = "".join(mill.cnc.messages())
    assert "they are held" in output, output
    mill.cnc.abort()
