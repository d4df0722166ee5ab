"""kill -9 at random moments, again and again, on one history and one machine that keeps moving.

  kill_rounds.py --rounds 200 --seed 1     prints, last, "NAME VALUE UNIT" lines; 1: something lost

What is checked in every round, against notes taken from outside just before the kill:
  * every row of the history that a reader could see is there afterwards, byte for byte;
  * reference and switch are those of before; of a command under way, before or after, and after
    when it had been answered;
  * the first order to the controller is no farther from the last one than the slew rate allows for
    the time since the daemon was first told what the controller applies, and one cycle more. No
    slack: both times are taken at the controller, the earlier one before it answers, the later one
    after it was written.
"""

import argparse
import contextlib
import math
import pathlib
import random
import socket
import sqlite3
import statistics
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
CYCLE_S = 0.01  # the offset moves at its ticks, the first of which may come at once
MOMENTS = ("running", "start", "commit", "reload", "command")


class WatchedController(PlainController):
    """Notes also when the applied offset was asked for."""

    def start(self):
        self.read_log = []
        super().start()

    def answer(self, pdu):
        if pdu[0] == 4:
            self.read_log.append(time.monotonic())
        return super().answer(pdu)


class KillRounds:
    def __init__(self, lab, seed):
        self.random = random.Random(seed)
        self.machine = Machine(lab)
        self.controller = self.machine.controller
        self.controller.__class__ = WatchedController
        self.controller.stop()
        self.controller.start()
        self.lab = lab
        self.daemon = self.machine.daemon
        self.rows = {}  # (table, id) -> checksum of the row
        self.lost = 0
        self.steps_um = []
        self.shares = []
        self.restarts_wrong = []
        self.counts = dict.fromkeys(MOMENTS, 0)
        self.moving = True
        self.mover = threading.Thread(target=self.move, daemon=True)
        self.mover.start()

    def move(self):
        """The target swings much faster than the slew rate: the offset never stands."""
        begun = time.monotonic()
        while self.moving:
            self.machine.warm_by(25.0 * math.sin((time.monotonic() - begun) * 2.0 * math.pi / 6.0))
            time.sleep(0.02)

    def note_rows(self):
        """What a reader sees committed now; also finds what is gone."""
        if not self.daemon.history.exists():
            return
        with contextlib.closing(sqlite3.connect(f"file:{self.daemon.history}?mode=ro",
                                                uri=True)) as base:
            base.execute("BEGIN")
            seen = {}
            # Of a segment only what never changes; its end moves with every commit.
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
        """Restart and what the controller saw of it."""
        with self.controller.lock:
            reads, orders = len(self.controller.read_log), len(self.controller.order_log)
            before = self.controller.order_log[-1][1] if orders else None
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
        self.shares.append(step / allowed)
        if step > allowed:
            self.restarts_wrong.append(f"a step of {step} um, {allowed} um allowed")

    def send_command(self, method):
        """Sends without waiting; the socket, on which the answer may come."""
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
        """Returns what may be found after the restart: a list of (enabled, reference or None)."""
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
                self.daemon.kill()
                link.settimeout(1.0)
                try:
                    answered = b'"result"' in link.recv(4096)
                except OSError:
                    answered = False
            enabled, reference = expected
            after = (method != "disable" if method != "reference" else enabled,
                     None if method == "reference" else reference)
            return [after] if answered else [expected, after]
        self.daemon.kill()
        return [expected]

    def check_state(self, allowed):
        enabled, reference = self.expectation()
        if not any(enabled == may and wanted in (None, reference) for may, wanted in allowed):
            self.restarts_wrong.append(f"{enabled}, {reference} is none of {allowed}")

    def run_round(self):
        moment = self.random.choice(MOMENTS)
        self.counts[moment] += 1
        if not self.daemon.status()["enabled"]:
            self.daemon.call("enable")
        time.sleep(0.2 * self.random.random())
        expected = self.expectation()
        if moment == "start":
            # Killed once running, then again somewhere in its start.
            allowed = self.kill_at("running", expected)
            self.note_rows()
            self.daemon.start(wait=False)
            time.sleep(0.4 * self.random.random())
            self.daemon.kill()
        else:
            allowed = self.kill_at(moment, expected)
        self.note_rows()
        self.start_ready()
        self.check_state(allowed)

    def run(self, rounds):
        self.start_ready()
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


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--rounds", type=int, default=200)
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    print(f"seed {given.seed}")
    with tempfile.TemporaryDirectory() as folder:
        lab = Lab(pathlib.Path(folder))
        try:
            kills = KillRounds(lab, given.seed)
            begun = time.monotonic()
            kills.run(given.rounds)
            kills.print_figures(given.rounds, time.monotonic() - begun)
        finally:
            lab.end()
    return 1 if kills.lost or kills.restarts_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
