"""The process itself: signals, stops, kills, reloads at the wrong moment, clocks, full disks."""

import contextlib
import os
import pathlib
import struct
import subprocess
import threading
import time

import watch
from machine import RESOLUTION_UM
from process import eventually
from registry import attack

BEFORE_UM = -3.0
DAY_NS = 86_400_000_000_000


def moves(rig):
    rig.machine.wants_um(rig.random.uniform(-25.0, 25.0))


def calls_in_background(daemon, method):
    """A thread that calls and does not care for the answer."""
    def call():
        with contextlib.suppress(OSError, ValueError, watch.Refused):
            daemon.call(method)
    thread = threading.Thread(target=call, daemon=True)
    thread.start()
    return thread


@attack(links=("tcp", "rtu"), limit_s=90.0)
def kill_9_again_and_again(rig):
    """At random moments: running, starting, reloading, committing."""
    if not rig.start(BEFORE_UM):
        return
    for _ in range(10):
        rig.tries += 1
        moves(rig)
        time.sleep(rig.random.uniform(0.0, 0.6))
        rig.note_rows()
        if rig.random.random() < 0.3:
            rig.daemon.hang_up()
            time.sleep(rig.random.uniform(0.0, 0.04))
        rig.daemon.kill()
        rig.note_rows()
        if rig.random.random() < 0.3:
            rig.daemon.start(wait=False)
            time.sleep(rig.random.uniform(0.0, 0.3))
            rig.daemon.kill()
        if not rig.restart():
            return
    rig.wait_for_rows(1)
    rig.must(rig.daemon.wait_for("compensating"), "does not compensate in the end")
    rig.follows_again()
    rig.note_rows()


@attack(links=("tcp",), rate_hz=1, limit_s=150.0)
def stopped_around_a_reload(rig):
    """A cycle of 1 Hz, the whole process stopped for 6 s while a reload is on its way; then another
    reload, `disable`, and a restart."""
    if not rig.start(BEFORE_UM):
        return
    for _ in range(3):
        rig.tries += 1
        moves(rig)
        asked = calls_in_background(rig.daemon, "reload")
        time.sleep(rig.random.uniform(0.0, 0.6))
        rig.daemon.stop_for(6.0)
        asked.join(15.0)
        if rig.random.random() < 0.5:
            calls_in_background(rig.daemon, "reload").join(15.0)
        if not rig.daemon.alive():
            return
        time.sleep(2.2)
        shown_um = rig.daemon.axis()["offset"]
        behind_um = abs(shown_um - rig.axis.position_um)
        rig.must(behind_um <= 3.0 * rig.axis.rate_um_per_s,
                 f"status shows {shown_um:.1f} um while the controller was sent "
                 f"{rig.axis.position_um:.1f}")
        rig.daemon.operate("disable")
        time.sleep(rig.random.choice((0.0, 1.5)))
        rig.daemon.kill()
        if not rig.restart():
            return
        rig.daemon.operate("enable")
        rig.must(rig.daemon.wait_for("compensating"), "does not compensate when enabled")
    rig.note_rows()


@attack(links=("tcp",), rate_hz=1, limit_s=90.0)
def hang_ups_at_1_Hz(rig):
    """SIGHUP each 0.4 s, faster than a cycle of 1 Hz takes configurations over."""
    if not rig.start(BEFORE_UM):
        return
    moves(rig)
    end = time.monotonic() + 14.0
    while time.monotonic() < end and rig.daemon.alive():
        rig.daemon.hang_up()
        time.sleep(0.4)
    time.sleep(2.0)
    rig.wait_for_rows(1)


@attack(links=("tcp", "bridge"))
def hang_ups_by_the_thousand(rig):
    """SIGHUP 200 times a second, the bound and slew rate in the file changing meanwhile."""
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
    """An offset that is outside of the new bound comes in at the slew rate."""
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
    """SIGSTOP and SIGCONT at any moment while the axis is on its way."""
    if not rig.start(BEFORE_UM):
        return
    for _ in range(5):
        moves(rig)
        time.sleep(rig.random.uniform(0.0, 0.4))
        rig.daemon.stop_for(rig.random.choice((0.05, 0.3, 0.9, 1.5, 2.5)))
    rig.follows_again()
    rig.note_rows()


class Clocks:
    """The daemon's clocks by a library that is preloaded (clocks.cpp)."""

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
    """The wall clock jumps by decades, forth and back, while rows are committed."""
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
    status, said = rig.tool("export", rig.daemon.history, "-o", run)
    rig.must(status in (0, 1), f"export after it refuses: {said.strip()[:120]}")
    status, said = rig.tool("replay", rig.daemon.history, "-o", rig.folder / "out.csv")
    rig.must(status == 0, f"replay after it: {said.strip()[:120]}")


@attack(links=("tcp",))
def sleeps_that_fail(rig):
    """The kernel refuses the cycle's sleep: no spinning on a whole processor, and it is told."""
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
             "nobody is told")
    rig.follows_again()
    rig.note_rows()


@attack(links=("tcp",), limit_s=120.0)
def full_disk(rig):
    """History and state on a disk without a free byte: nothing committed is lost, nobody is told
    "done" of what a restart would undo."""
    folder = rig.daemon.folder
    if os.geteuid() != 0 or subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(folder)],
            capture_output=True).returncode != 0:
        return
    rig.closing.append(lambda: subprocess.run(["umount", "-l", str(folder)], check=False))
    rig.daemon.write_config()
    if not rig.start(BEFORE_UM):
        return
    rig.wait_for_rows()
    rig.machine.wants_um(-25.0)
    ballast = folder / "ballast"

    def noticed():
        with open(ballast, "ab", buffering=0) as file, contextlib.suppress(OSError):
            while True:
                file.write(bytes(1024))
        return not rig.daemon.status().get("history", {}).get("working", True)
    rig.must(eventually(noticed), "the full disk is not told")
    rig.note_rows()
    rig.daemon.operate(rig.random.choice(("disable", "reference")))
    rig.daemon.kill()
    if not rig.restart():
        return
    ballast.unlink()
    rig.must(eventually(lambda: rig.daemon.status()["history"]["working"], 90.0),
             "the history does not go on with room again")
    rig.note_rows()
    rig.daemon.operate("enable")
    rig.must(rig.daemon.wait_for("compensating"), "does not compensate in the end")
    rig.note_rows()


@attack(links=("tcp",))
def two_daemons_on_one_history(rig):
    """The second writes into the file of the first, or does not start."""
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(-20.0)
    rig.wait_for_rows()
    second = rig.another_daemon("two", unit=9, history=rig.daemon.history, dry_run=True)
    started = second.start(may_refuse=True)
    rig.must(not started, "a second daemon starts on the same history")
    if started:
        for _ in range(10):
            time.sleep(0.2)
            rig.note_rows()
        second.end()
    rig.wait_for_rows(1)
    rig.follows_again()


@attack(links=("tcp",))
def two_daemons_on_one_state_file(rig):
    """What one is told the other would undo."""
    if not rig.start(BEFORE_UM):
        return
    rig.daemon.operate("disable")
    second = rig.another_daemon("two", unit=9, dry_run=True)
    text = second.config.read_text().replace(str(second.state), str(rig.daemon.state))
    second.config.write_text(text)
    started = second.start(may_refuse=True)
    rig.must(not started, "a second daemon starts on the same state file")
    if started:
        second.operate("enable")
        rig.told_enabled = False
        second.end()
    rig.daemon.kill()
    rig.restart()


@attack(links=("tcp",))
def two_daemons_on_one_configuration(rig):
    """Started twice by mistake: the second goes, the first stays as it is."""
    if not rig.start(BEFORE_UM):
        return
    rig.wait_for_rows()
    second = rig.another_daemon("two")
    second.config = rig.daemon.config
    rig.must(not second.start(may_refuse=True), "it runs twice")
    rig.must(rig.daemon.status()["mode"] == "compensating", "the first one is disturbed")
    rig.wait_for_rows(1)
    rig.follows_again()
