"""Repeated kill -9 at random times, with one history and one continually moving machine.

    kill_rounds.py --rounds 200 --seed 1   prints, last, "NAME VALUE UNIT" lines; 1: something lost
        --controller registers             no read-back except the written registers
        --controller silent                these cannot be read either
        --power-cuts    of a silent one: the record of the runtime folder is lost, and the state
                        file is the one last flushed
        --no-history    faster: checks only the offsets

Checked in every round against observations just before the kill:
  * all rows of the history visible to a reader are still there, byte for byte;
  * reference and switch are those of before; those of a command under way are those before or
    after it, or after it if it had been answered;
  * the first order to the controller differs from the last one at most by the slew limit times
    the time since the daemon's first read-back, plus one cycle. No slack: both times are taken
    at the controller, the earlier before it answers, the later after it was written. For a
    silent controller the time from its last order to the kill counts too, and after a power cut
    restart_leap_um_max.
"""

import argparse
import contextlib
import math
import pathlib
import random
import re
import shutil
import socket
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from lab import Lab, assert_replays_exactly, eventually  # noqa: E402
from plain_devices import RATE_UM_PER_S, Machine, PlainController  # noqa: E402

RESOLUTION_UM = 0.001
PERIOD_S = 0.02  # of the controller's link
CYCLE_S = 0.01  # offsets move at its ticks, the first possibly at once
LEAP_UM = 1.0  # restart_leap_um_max
MOMENTS = ("running", "start", "commit", "reload", "command")

# When a folder has been flushed, so has a file renamed in it before.
DURABLE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
int fsync(int fd) {
  static int (*real)(int);
  if (!real) real = (int (*)(int))dlsym(RTLD_NEXT, "fsync");
  const int result = real(fd);
  struct stat status;
  if (result != 0 || fstat(fd, &status) != 0 || !S_ISDIR(status.st_mode)) return result;
  char bytes[65536];
  char beside[4096];
  snprintf(beside, sizeof beside, "%s.new", getenv("DURABLE_FILE"));
  FILE* from = fopen(getenv("STATE_FILE"), "r");
  FILE* to = fopen(beside, "w");
  if (from && to) fwrite(bytes, 1, fread(bytes, 1, sizeof bytes, from), to);
  if (from) fclose(from);
  if (to && fclose(to) == 0) rename(beside, getenv("DURABLE_FILE"));
  return result;
}
"""


class WatchedController(PlainController):
    """Also records the times at which the applied offset was read or written."""

    silent = False
    asked_by = (4,)

    def start(self):
        self.read_log = []
        super().start()

    def answer(self, pdu, unit=1):
        if pdu[0] in self.asked_by:
            self.read_log.append(time.monotonic())
        if self.silent and pdu[0] == 3:
            return bytes([0x83, 2])
        return super().answer(pdu, unit)


class KillRounds:
    def __init__(self, lab, seed, controller="read_back", power_cuts=False, history=True):
        self.random = random.Random(seed)
        self.machine = Machine(lab)
        self.controller = self.machine.controller
        self.controller.__class__ = WatchedController
        self.controller.stop()
        self.reads_back = controller == "read_back"
        self.power_cuts = power_cuts
        self.history = history
        self.controller.silent = controller == "silent"
        self.controller.asked_by = (4,) if self.reads_back else (2, 3)
        self.killed_at = 0.0
        config = self.machine.config
        if not self.reads_back:
            config = re.sub(r"(?m)^applied = .*\n", "", config)
        if not self.history:
            config = config.replace("@HISTORY@\n", "enabled = false\n@HISTORY@\n")
        self.machine.daemon.write_config(config)
        if self.power_cuts:
            self.durable = lab.folder / "durable.json"
            shim = lab.folder / "durable.so"
            subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-xc", "-", "-o", shim, "-ldl"],
                           input=DURABLE.encode(), check=True)
            self.machine.daemon.environment = {"LD_PRELOAD": str(shim),
                                               "STATE_FILE": str(self.machine.daemon.state),
                                               "DURABLE_FILE": str(self.durable)}
        self.controller.start()
        self.lab = lab
        self.daemon = self.machine.daemon
        self.rows = {}  # (table, id) -> checksum of the row
        self.lost = 0
        self.steps_um = []
        self.shares = []
        self.away = []
        self.restarts_wrong = []
        self.counts = dict.fromkeys(MOMENTS, 0)
        self.moving = True
        self.mover = threading.Thread(target=self.move, daemon=True)
        self.mover.start()

    def move(self):
        """Moves the target much faster than the slew limit, so that the offset never rests."""
        begun = time.monotonic()
        while self.moving:
            self.machine.warm_by(25.0 * math.sin((time.monotonic() - begun) * 2.0 * math.pi / 6.0))
            time.sleep(0.02)

    def note_rows(self):
        """Reads the committed rows; counts the lost ones."""
        if not self.history or not self.daemon.history.exists():
            return
        with contextlib.closing(sqlite3.connect(f"file:{self.daemon.history}?mode=ro",
                                                uri=True)) as base:
            base.execute("BEGIN")
            seen = {}
            # Constant columns of a segment only; its end moves with every commit.
            for row in base.execute("SELECT id, run, token, setup, reason, first_cycle, inputs, "
                                    "estimator_state FROM segment"):
                seen["segment", row[0]] = zlib.crc32(repr(row).encode())
            for row in base.execute("SELECT id, segment, number, through_cycle, count, records "
                                    "FROM chunk"):
                seen["chunk", row[0]] = zlib.crc32(repr(row).encode())
        gone = [key for key, check in self.rows.items() if seen.get(key) != check]
        if gone:
            print("lost:", gone)
        self.lost += len(gone)
        self.rows = seen

    def expectation(self):
        status = self.daemon.status()
        return status["enabled"], [each["reference_degC"] for each in status["inputs"]]

    def start_ready(self):
        """Restarts the daemon and checks the first step at the controller."""
        time.sleep(0.05)  # until bytes in transit have arrived
        with self.controller.lock:
            reads, orders = len(self.controller.read_log), len(self.controller.order_log)
            before_at, before = self.controller.order_log[-1] if orders else (0.0, None)
        if self.power_cuts and before is not None:
            self.cut_power()
        self.daemon.start()
        eventually(lambda: len(self.controller.orders()) > orders + 1, "orders after the restart")
        if before is None:
            return
        with self.controller.lock:
            told_at = self.controller.read_log[reads]
            ordered_at, first = self.controller.order_log[orders]
        step = abs(first - before)
        self.steps_um.append(step)
        allowed = RATE_UM_PER_S * (ordered_at - told_at + CYCLE_S) + RESOLUTION_UM
        if self.power_cuts:
            allowed = max(allowed, LEAP_UM + RATE_UM_PER_S * CYCLE_S)
        elif self.controller.silent:
            # A recorded offset may not have been sent yet.
            allowed += RATE_UM_PER_S * (max(0.0, self.killed_at - before_at) + CYCLE_S)
        self.away.append(step / (RATE_UM_PER_S * (ordered_at - before_at)))
        self.shares.append(step / allowed)
        if step > allowed:
            self.restarts_wrong.append(f"a step of {step} um, {allowed} um allowed")

    def cut_power(self):
        """Unflushed data may or may not survive."""
        self.daemon.socket.with_name(self.daemon.socket.name + ".sent").unlink(missing_ok=True)
        if self.random.random() < 0.8:
            shutil.copyfile(self.durable, self.daemon.state)

    def kill(self):
        self.killed_at = time.monotonic()
        self.daemon.kill()

    def release_where_unknown(self):
        """A first start with nothing known: the operator has checked that the offset is 0."""
        def started():
            status = self.daemon.status()
            if "start_unknown" in status["reasons"]:
                self.daemon.call("release", axis="z")
            return status["axes"][0]["driven"]

        eventually(started, "the axis is driven")

    def send_command(self, method):
        """Sends without waiting; returns the socket of the answer."""
        link = socket.socket(socket.AF_UNIX)
        link.connect(str(self.daemon.socket))
        params = b',"params":{"force":true}' if method == "reference" else b""
        link.sendall(b'{"jsonrpc":"2.0","id":1,"method":"%s"%s}\n' % (method.encode(), params))
        return link

    def wait_for_commit(self):
        log = pathlib.Path(str(self.daemon.history) + "-wal")
        first = log.stat().st_mtime_ns if log.exists() else 0
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            if log.exists() and log.stat().st_mtime_ns != first:
                return
            time.sleep(0.0002)

    def kill_at(self, moment, expected):
        """Returns the allowed states after the restart: a list of (enabled, reference or None)."""
        self.note_rows()
        pause = self.random.random()
        if moment == "running":
            time.sleep(0.3 * pause)
        elif moment == "commit":
            self.wait_for_commit()
            time.sleep(0.003 * pause)
        elif moment == "reload":
            self.daemon.hang_up()
            time.sleep(0.04 * pause)
        elif moment == "command":
            method = self.random.choice(("enable", "disable", "reference"))
            with contextlib.closing(self.send_command(method)) as link:
                time.sleep(0.06 * pause)
                self.kill()
                link.settimeout(1.0)
                try:
                    answered = b'"result"' in link.recv(4096)
                except OSError:
                    answered = False
            enabled, reference = expected
            after = (method != "disable" if method != "reference" else enabled,
                     None if method == "reference" else reference)
            return [after] if answered else [expected, after]
        self.kill()
        return [expected]

    def check_state(self, allowed):
        enabled, reference = self.expectation()
        if not any(enabled == may and wanted in (None, reference) for may, wanted in allowed):
            self.restarts_wrong.append(f"{enabled}, {reference} is none of {allowed}")

    def run_round(self):
        moment = self.random.choice(MOMENTS)
        if moment == "commit" and not self.history:
            moment = "running"
        self.counts[moment] += 1
        if not self.daemon.status()["enabled"]:
            self.daemon.call("enable")
        # Sometimes long, so that periodically saved values are old.
        longest_s = 4.0 if self.random.random() < 0.1 else 0.2
        time.sleep(longest_s * self.random.random())
        expected = self.expectation()
        if moment == "start":
            # Killed while running, then again during its start.
            allowed = self.kill_at("running", expected)
            self.note_rows()
            self.daemon.start(wait=False)
            time.sleep(0.4 * self.random.random())
            self.kill()
        else:
            allowed = self.kill_at(moment, expected)
        self.note_rows()
        self.start_ready()
        self.check_state(allowed)

    def run(self, rounds):
        self.daemon.start()
        self.release_where_unknown()
        self.daemon.wait_for_mode("compensating")
        for number in range(rounds):
            self.run_round()
            print(f"round {number + 1}: {len(self.rows)} rows noted, {self.lost} lost, "
                  f"step {self.steps_um[-1]:.3f} um", file=sys.stderr, flush=True)
        self.note_rows()
        self.daemon.end()
        self.note_rows()
        self.moving = False
        self.mover.join()
        if self.history:
            assert_replays_exactly(self.daemon.history, self.lab.folder / "out.csv")

    def print_figures(self, rounds, took_s):
        print("moments of the kills: " +
              ", ".join(f"{name} {count}" for name, count in self.counts.items()))
        for wrong in self.restarts_wrong:
            print("wrong after a restart:", wrong)
        print(f"kills {rounds + self.counts['start']} kills")
        print(f"seconds_a_round {took_s / rounds:.2f} s")
        print(f"committed_rows {len(self.rows)} rows")
        print(f"committed_rows_lost {self.lost} rows")
        print(f"restarts_wrong {len(self.restarts_wrong)} restarts")
        print(f"slew_times_period {RATE_UM_PER_S * PERIOD_S + RESOLUTION_UM:.3f} um")
        beyond = sum(step > RATE_UM_PER_S * PERIOD_S + RESOLUTION_UM for step in self.steps_um)
        print(f"restart_steps_beyond_it {beyond} restarts")
        print(f"restart_step_median {statistics.median(self.steps_um):.3f} um")
        print(f"restart_step_largest {max(self.steps_um):.3f} um")
        print(f"step_over_allowed_largest {max(self.shares):.3f} ratio")
        print(f"step_over_slew_times_away_largest {max(self.away):.3f} ratio")


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--rounds", type=int, default=200)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--controller", choices=("read_back", "registers", "silent"),
                         default="read_back")
    options.add_argument("--power-cuts", action="store_true")
    options.add_argument("--no-history", dest="history", action="store_false")
    given = options.parse_args()
    print(f"seed {given.seed}")
    with tempfile.TemporaryDirectory() as folder:
        lab = Lab(pathlib.Path(folder))
        try:
            kills = KillRounds(lab, given.seed, given.controller, given.power_cuts, given.history)
            begun = time.monotonic()
            kills.run(given.rounds)
            kills.print_figures(given.rounds, time.monotonic() - begun)
        finally:
            lab.end()
    return 1 if kills.lost or kills.restarts_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
