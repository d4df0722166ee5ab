"""Arbitrary thermocouple values and command parameters: bound and slew limit are kept."""

import math
import struct
import time

from lab import Refused
from process import eventually
from registry import attack

BEFORE_UM = -3.0
LOOKED_AT_S = 4.0


@attack(links=("tcp", "rtu", "can", "piezo"))
def hostile_thermocouples(rig):
    """Every raw word, jumps over the whole range, toggling values."""
    if not rig.start(BEFORE_UM):
        return
    end = time.monotonic() + LOOKED_AT_S
    kind = rig.random.choice(("words", "ends", "toggles", "all"))
    while time.monotonic() < end:
        now = rig.random.choice(("words", "ends", "toggles")) if kind == "all" else kind
        if now == "ends":
            rig.machine.thermocouples.show(rig.random.choice((-29.9, 119.9)),
                                           rig.random.choice((-29.9, 119.9)))
        elif now == "toggles":
            rig.machine.thermocouples.show(rig.random.choice((20.0, 40.0, 1e6)), 20.0)
        else:
            show_words(rig)
        time.sleep(rig.random.choice((0.005, 0.05, 0.3)))
    if rig.machine.link == "can":
        rig.machine.thermocouples.data = None
    rig.follows_again()


def show_words(rig):
    if rig.machine.link == "can":
        rig.machine.thermocouples.data = rig.random.randbytes(rig.random.randint(0, 8)) or b"\0"
    else:
        rig.machine.thermocouples.registers.put(4, 0, [rig.random.randrange(65536)
                                                       for _ in range(4)])


@attack(links=("tcp",), encoding="float32")
def thermocouples_that_are_no_numbers(rig):
    """NaN, infinities and the ends of float32."""
    if not rig.start(BEFORE_UM):
        return
    values = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-42, 20.0)
    end = time.monotonic() + LOOKED_AT_S
    while time.monotonic() < end:
        for address in (0, 2):
            words = struct.unpack(">2H", struct.pack(">f", rig.random.choice(values)))
            rig.machine.thermocouples.registers.put(4, address, words)
        time.sleep(0.02)
    rig.follows_again()


CORRECTED = """[correction]
form = "recursive"
[[correction.group]]
inputs = ["column_degC"]
[[correction.group]]
inputs = ["spindle_degC"]
"""


@attack(links=("tcp",), more=CORRECTED)
def measured_without_end(rig):
    """`measured z 1e308` and similar, with a model that corrects itself: each changes the estimate
    by at most `step_um_max`, and nothing becomes infinite."""
    if not rig.start(BEFORE_UM):
        return
    values = (1e308, -1e308, 1e300, 1e39, -1e17, 900.0, -400.0, 3.0 * rig.axis.bound_um)
    for _ in range(20):
        value_um = rig.random.choice(values)
        try:
            rig.daemon.call("measured", axis="z", value_um=value_um)
            rig.broke(f"measured z {value_um:g} is taken")
        except (Refused, OSError, ValueError):
            pass
        axis = rig.daemon.axis()
        if not rig.must(axis.get("target") is not None and axis.get("displacement") is not None,
                        "target or displacement is no number any more"):
            break
        time.sleep(0.05)
    for value in ("1e308", "900"):
        status, _ = rig.tool("--socket", rig.daemon.socket, "measured", "z", value)
        rig.must(status == 2, f"thermocomp measured z {value} is taken (exit status {status})")
    rig.daemon.kill()
    rig.restart()
    rig.must(rig.daemon.wait_for("compensating"), "does not compensate after a restart")
    rig.follows_again()


@attack(links=("tcp", "bridge"))
def operator_gone_mad(rig):
    """Reference, switch, proving moves and cycle ends in random order, as fast as they are
    answered; a restart must restore what was acknowledged last."""
    if not rig.start(BEFORE_UM):
        return
    end = time.monotonic() + LOOKED_AT_S
    while time.monotonic() < end:
        rig.machine.wants_um(rig.random.uniform(-30.0, 30.0))
        for _ in range(rig.random.randint(1, 5)):
            method = rig.random.choice(("enable", "disable", "reference", "prove", "cycle_end",
                                        "measured", "reload"))
            params = {"axis": "z", "value_um": rig.random.uniform(-12.0, 12.0)} \
                if method in ("prove", "measured") else {}
            rig.daemon.operate(method, **params)
    rig.machine.wants_um(0.0)
    time.sleep(0.3)
    rig.told_reference = None  # acknowledged reference may have been replaced
    rig.daemon.operate(rig.random.choice(("disable", "enable")))
    rig.daemon.operate("reference")
    rig.daemon.kill()
    rig.restart()


@attack(links=("tcp",))
def commands_and_kills(rig):
    """kill -9 right after an answer "done": the command is still in effect after the restart."""
    rig.start(BEFORE_UM)
    for _ in range(6):
        rig.tries += 1
        rig.machine.wants_um(rig.random.uniform(-20.0, 20.0))
        time.sleep(rig.random.uniform(0.0, 0.2))
        for method in rig.random.sample(("enable", "disable", "reference"), 2):
            rig.daemon.operate(method)
        rig.daemon.kill()
        if not rig.restart():
            return
    rig.daemon.operate("enable")
    rig.must(eventually(lambda: rig.daemon.status()["mode"] == "compensating"),
             "does not compensate in the end")
