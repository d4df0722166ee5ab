"""Attacks on the process: signals, stops, reloads at the wrong time, clocks."""

import pathlib
import struct
import subprocess
import time

from machine import RESOLUTION_UM
from process import eventually
from registry import attack

BEFORE_UM = -3.0
DAY_NS = 86_400_000_000_000


def moves(rig):
    rig.machine.wants_um(rig.random.uniform(-25.0, 25.0))


@attack(links=("tcp", "bridge"))
def hang_ups_by_the_thousand(rig):
    """SIGHUP 200 times a second while bound and slew limit in the file change."""
    if not rig.start(BEFORE_UM):
        return
    moves(rig)
    end = time.monotonic() + 4.0
    while time.monotonic() < end and rig.daemon.alive():
        if rig.random.random() < 0.05:
            rig.daemon.write_config(rate=rig.random.choice((0.5, 1.0, 2.0)))
        rig.daemon.hang_up()
        time.sleep(0.005)
    rig.daemon.write_config(rate=2.0)
    rig.daemon.hang_up()
    rig.follows_again()
    rig.note_rows()


@attack(links=("tcp",))
def smaller_bound_by_reload(rig):
    """An offset outside a new, smaller bound returns at the slew limit."""
    if not rig.start(-6.0):
        return
    rig.daemon.write_config(bound=2.0)
    rig.daemon.operate("reload")
    rig.must(eventually(lambda: abs(rig.axis.position_um) <= 2.0 + RESOLUTION_UM),
             "stays outside of the new bound")
    rig.daemon.write_config(bound=50.0)
    rig.daemon.operate("reload")
    rig.follows_again()


@attack(links=("tcp", "rtu"), limit_s=60.0)
def stopped_for_seconds(rig):
    """SIGSTOP and SIGCONT at random times while the axis moves."""
    if not rig.start(BEFORE_UM):
        return
    for _ in range(5):
        moves(rig)
        time.sleep(rig.random.uniform(0.0, 0.4))
        rig.daemon.stop_for(rig.random.choice((0.05, 0.3, 0.9, 1.5, 2.5)))
    rig.follows_again()
    rig.note_rows()


class Clocks:
    """Controls the daemon's clocks through a preloaded library (clocks.cpp)."""

    def __init__(self, rig):
        library, shared = rig.folder / "clocks.so", rig.folder / "clocks"
        source = pathlib.Path(__file__).with_name("clocks.cpp")
        subprocess.run(["c++", "-std=c++20", "-O1", "-shared", "-fPIC", "-o", library, source],
                       check=True)
        shared.write_bytes(bytes(16))
        self.shared = shared.open("r+b", buffering=0)
        rig.closing.append(self.shared.close)
        rig.daemon.environment = {"LD_PRELOAD": str(library), "THERMOCOMP_CLOCKS": str(shared)}

    def set(self, days=0, sleeps_fail=False):
        self.shared.seek(0)
        self.shared.write(struct.pack("=2q", days * DAY_NS, int(sleeps_fail)))


@attack(links=("tcp",))
def clock_jumps(rig):
    """The wall clock jumps by decades, forwards and back, while rows are committed."""
    clocks = Clocks(rig)
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(-20.0)
    for days in rig.random.sample((-20_000, 60_000, 3650, -1, 40_000, -3650), 4):
        clocks.set(days)
        time.sleep(0.6)
        rig.note_rows()
    clocks.set()
    rig.wait_for_rows(1)
    rig.follows_again()
    rig.note_rows()
    rig.daemon.end()
    run = rig.folder / "run.csv"
    status, output = rig.tool("export", rig.daemon.history, "-o", run)
    rig.must(status in (0, 1), f"export after it refuses: {output.strip()[:120]}")
    status, output = rig.tool("replay", rig.daemon.history, "-o", rig.folder / "out.csv")
    rig.must(status == 0, f"replay after it: {output.strip()[:120]}")


@attack(links=("tcp",))
def sleeps_that_fail(rig):
    """The cycle's sleep fails: the daemon must not use a whole processor, and must report it."""
    clocks = Clocks(rig)
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(-20.0)
    clocks.set(sleeps_fail=True)
    time.sleep(0.2)
    used, began = rig.daemon.cpu_s(), time.monotonic()
    time.sleep(1.5)
    share = (rig.daemon.cpu_s() - used) / (time.monotonic() - began)
    rig.must(share < 0.5, f"uses {100 * share:.0f} % of a processor")
    clocks.set()
    rig.must("sleep" in rig.daemon.log_text() or
             any("sleep" in warning for warning in rig.daemon.status()["warnings"]),
             "nothing is reported")
    rig.follows_again()
    rig.note_rows()
