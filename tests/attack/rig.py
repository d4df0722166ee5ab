"""The attacked daemon, its machine, and all records of both.

An attack uses a Rig and states with `must()` its conditions besides the invariants; judge() then
checks the records: the axis at the controller's side, processes, history rows, operator's commands,
watchdog notifications, response times of a client."""

import contextlib
import json
import math
import pathlib
import random
import re
import shutil
import sqlite3
import subprocess
import tempfile
import time
import zlib

import watch
from lab import PATIENCE_S, Refused
from machine import RESOLUTION_UM, Machine
from process import WATCHDOG_S, Daemon, eventually
from service_manager import Metronome, ServiceManager

ANSWER_S = 2.0
INVARIANTS = re.findall(r'\{"(\w+)",',
                        (pathlib.Path(__file__).parents[1] / "invariant_list.hpp").read_text())
UNCHANGING_SEGMENT = "id, run, token, setup, reason, first_cycle, inputs, estimator_state"
CHUNK = "id, segment, number, through_cycle, count, records"


def is_database(path):
    with contextlib.suppress(OSError):
        return path.is_file() and path.open("rb").read(15) == b"SQLite format 3"
    return False


class Rig:
    def __init__(self, programs, link, seed, **choices):
        self.bin = pathlib.Path(programs).resolve()
        self.random = random.Random(seed)
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tca"))
        self.machine = Machine(self.folder, link, **choices)
        self.axis = self.machine.axis
        self.metronome = Metronome()
        self.manager = ServiceManager(self.folder / "notify")
        self.daemons = []
        self.client = None
        self.broken = []
        self.tries = 0
        self.rows = set()
        self.rows_lost = 0
        self.told_enabled = None
        self.told_reference = None
        self.commands_lost = 0
        self.ended = 0
        self.closing = []
        self.daemon = self.another_daemon("one")

    def another_daemon(self, name, unit=1, **other):
        """A daemon, not yet started, with its own files unless `other` names them."""
        socket = other.pop("socket", self.folder / (name + ".sock"))
        made = Daemon(self, self.folder / name, socket, unit, **other)
        self.daemons.append(made)
        return made

    def start(self, offset_um=None):
        """Starts the first daemon and waits until it compensates (and has reached the offset)."""
        if not self.daemon.start():
            self.broke("the daemon does not start")
            return False
        if hasattr(self.machine.slave, "report_to"):
            self.machine.slave.report_to(self.daemon.socket)
        if self.client is None:
            self.client = watch.Client(self.daemon.socket)
        self.client.paused = False
        if not self.daemon.wait_for("compensating"):
            self.broke("never compensating before the attack")
            return False
        if offset_um is not None:
            self.machine.wants_um(offset_um)
            if not eventually(lambda: abs(self.axis.position_um - offset_um) < 0.5):
                status = self.daemon.status()
                self.broke(f"never at {offset_um} um before the attack: {status['mode']}, "
                           f"{status['reasons']}, {status['axes'][0]}")
                return False
        return True

    def restart(self):
        """Starts it after a kill or an end: acknowledged commands must still be in effect."""
        if not self.daemon.start():
            self.broke("the daemon does not start again")
            return False
        if self.told_enabled is not None or self.told_reference is not None:
            status = self.daemon.status()
            if self.told_enabled is not None and status["enabled"] != self.told_enabled:
                self.commands_lost += 1
            if self.told_reference is not None and self.daemon.references() != self.told_reference:
                self.commands_lost += 1
        return True

    def broke(self, what):
        if what not in self.broken:
            self.broken.append(what)

    def invariant(self, holds, name, what):
        assert name in INVARIANTS, name
        return self.must(holds, f"{name}: {what}")

    def must(self, holds, what):
        """A condition of this attack besides the invariants."""
        if not holds:
            self.broke(what)
        return holds

    def tool(self, *arguments, patience_s=60.0):
        """Runs thermocomp: (exit status, stdout and stderr); negative: a signal; None: timeout."""
        try:
            done = subprocess.run([str(self.bin / "thermocomp"), *map(str, arguments)],
                                  stdin=subprocess.DEVNULL, capture_output=True,
                                  timeout=patience_s)
        except subprocess.TimeoutExpired:
            return None, ""
        if done.returncode < 0 or done.returncode > 2:
            self.broke(f"thermocomp {arguments[0]} ended with {done.returncode}")
            self.ended += 1
        return done.returncode, (done.stdout + done.stderr).decode(errors="replace")

    def note_rows(self):
        """Reads committed rows from all history files; counts those lost since the last call."""
        seen = set()
        for history in {self.daemon.history, *self.daemon.folder.glob("*history*")}:
            if not is_database(history):
                continue
            with contextlib.closing(sqlite3.connect(f"file:{history}?mode=ro", uri=True,
                                                    timeout=20)) as base:
                base.execute("BEGIN")
                for table, columns in (("segment", UNCHANGING_SEGMENT), ("chunk", CHUNK)):
                    for row in base.execute(f"SELECT {columns} FROM {table}"):
                        seen.add((table, zlib.crc32(repr(row).encode())))
        self.rows_lost += len(self.rows - seen)
        self.rows = seen
        return len(seen)

    def wait_for_rows(self, more=5):
        """Waits for this number of further committed rows."""
        wanted = len(self.rows) + more
        return self.must(eventually(lambda: self.note_rows() >= wanted), "nothing is committed")

    def follows_again(self, patience_s=PATIENCE_S):
        """With true read-backs and an operator's releases, the axis must follow again."""
        stands_um = self.axis.position_um
        offset_um = stands_um - math.copysign(1.0, stands_um)
        self.machine.wants_um(offset_um)

        def there():
            if abs(self.axis.position_um - offset_um) < 0.3 and self.daemon.axis()["driven"]:
                return True
            if "mismatch_latched" in self.daemon.status()["reasons"]:
                self.release()
            return not self.daemon.alive()
        return self.must(bool(eventually(there, patience_s)) and self.daemon.alive(),
                         "does not follow after the attack")

    def release(self):
        with contextlib.suppress(OSError, ValueError, Refused):
            self.daemon.call("release", axis="z")

    # ---- the verdict

    def look_at_processes(self):
        for daemon in self.daemons:
            if daemon.process is not None and not daemon.alive() and not daemon.ends_expected:
                self.ended += 1
                self.broke(f"{daemon.folder.name}: ended with {daemon.process.returncode}")

    def end_all(self):
        self.look_at_processes()
        if self.client is not None:
            self.client.close()
        self.look_at_rows()
        for daemon in self.daemons:
            if daemon.alive():
                if not daemon.end():
                    self.ended += 1
                    self.broke(f"{daemon.folder.name}: ends with {daemon.process.returncode} "
                               "when asked to")
            if "broken promise" in daemon.log_text():
                self.broke("a promise of the code was broken: see the log")
        self.look_at_rows()

    def look_at_rows(self):
        try:
            self.note_rows()
        except sqlite3.Error as error:
            self.broke(f"the history cannot be read: {error}")

    def longest_unfed_s(self):
        longest = 0.0
        for daemon in self.daemons[:1]:
            fed_at_s = self.manager.times_of("WATCHDOG=1")
            for since, until in daemon.running:
                until = until or time.monotonic()
                fed = [since, *(at for at in fed_at_s if since < at < until), until]
                for earlier, later in zip(fed, fed[1:]):
                    late = self.metronome.lateness_s(earlier, later)
                    longest = max(longest, later - earlier - late)
        return longest

    def longest_wait_s(self):
        longest = 0.0
        for asked, answered in self.client.all_waits() if self.client else []:
            if not any(since <= asked and (until is None or answered <= until)
                       for since, until in self.daemon.running):
                continue
            longest = max(longest, answered - asked -
                          self.metronome.lateness_s(asked, answered))
        return longest

    def allowed_um(self, write):
        """Allowed step of a write: elapsed time since its predecessor can have been computed, one
        cycle for the cycle's grid, and the delays of this machine."""
        grid_s = 1.0 / self.machine.choices["rate_hz"]
        late_s = self.metronome.NOTED_FROM_S + self.metronome.lateness_s(write.since_s - 1.0,
                                                                         write.at_s)
        return write.rate_um_per_s * (write.at_s - write.since_s + grid_s + late_s) + \
            2 * RESOLUTION_UM

    def judge(self):
        """Ends everything; the results of the table as a dictionary."""
        self.end_all()
        largest = {"step_um": 0.0, "allowed_um": 0.0, "beyond": 0, "value_um": 0.0, "writes": 0}
        worst = -math.inf
        for write in self.axis.writes:
            largest["writes"] += 1
            largest["value_um"] = max(largest["value_um"], abs(write.value_um))
            self.invariant(abs(write.value_um) <= write.bound_um + RESOLUTION_UM,
                           "offset_within_bound", f"{write.value_um:.3f} um")
            if self.machine.link == "piezo":
                continue
            allowed = self.allowed_um(write)
            if write.step_um > allowed:
                largest["beyond"] += 1
            if write.step_um - allowed > worst:
                worst = write.step_um - allowed
                largest["step_um"], largest["allowed_um"] = write.step_um, allowed
        self.invariant(
            not largest["beyond"], "slew_kept_at_controller",
            f"{largest['beyond']} of {largest['writes']} writes leap, by {largest['step_um']:.3f} um "
            f"where {largest['allowed_um']:.3f} um may be")
        if self.machine.link == "piezo" and not self.axis.had_read_error:
            self.must(self.machine.controller.hysteresis == 0, "a voltage was not reached from 0 V")
        unfed_s, wait_s = self.longest_unfed_s(), self.longest_wait_s()
        self.must(unfed_s <= WATCHDOG_S, f"the watchdog got nothing for {unfed_s:.1f} s")
        self.must(wait_s <= ANSWER_S, f"a client waited {wait_s:.1f} s")
        self.invariant(self.rows_lost == 0, "no_committed_history_lost", f"{self.rows_lost} rows")
        self.invariant(self.commands_lost == 0, "state_survives_restart",
                       f"{self.commands_lost} operator's commands lost")
        return largest | {
            "tries": max(1, self.tries), "bound_um": self.axis.bound_um, "ended": self.ended,
            "rows": len(self.rows), "rows_lost": self.rows_lost,
            "commands_lost": self.commands_lost, "unfed_s": round(unfed_s, 2),
            "wait_s": round(wait_s, 2), "broken": self.broken}

    def close(self, keep=False):
        for daemon in self.daemons:
            if daemon.alive():
                daemon.process.kill()
                daemon.process.wait()
        for close in self.closing:
            with contextlib.suppress(OSError):
                close()
        self.machine.close()
        self.manager.close()
        self.metronome.close()
        if not keep:
            shutil.rmtree(self.folder, ignore_errors=True)


def print_result(result):
    print("RESULT " + json.dumps(result))
