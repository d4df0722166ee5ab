"""A daemon with its machine for the tests: processes, generated files, the status socket."""

import contextlib
import csv
import json
import math
import os
import pathlib
import shutil
import signal
import socket
import sqlite3
import subprocess
import tempfile
import time

BIN = pathlib.Path(os.environ.get("THERMOCOMP_BIN", "build/release/bin")).resolve()
SOURCE = pathlib.Path(__file__).resolve().parents[3]
DATA = pathlib.Path(os.environ.get("THERMOCOMP_DATA", SOURCE.parent / "shared" / "data"))
# Timeout for required events on a busy machine or with a sanitizer.
PATIENCE_S = float(os.environ.get("THERMOCOMP_PATIENCE_S", "30"))


def eventually(check, what, patience_s=PATIENCE_S):
    """Polls check() until it is true; returns its value."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        value = check()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError("never happened: " + what)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Refused(Exception):
    """The daemon's answer was an error."""


def connect(path, timeout_s=PATIENCE_S):
    link = socket.socket(socket.AF_UNIX)
    link.settimeout(timeout_s)
    try:
        link.connect(str(path))
    except OSError:
        link.close()
        raise
    return link


def request(method, **params):
    return json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).encode()


def call(path, method, timeout_s=PATIENCE_S, **params):
    """Result of a call on its own connection. Raises OSError, Refused, ValueError (no JSON)."""
    with connect(path, timeout_s) as link:
        link.sendall(request(method, **params) + b"\n")
        with link.makefile("rb") as lines:
            line = lines.readline()
    if not line:
        raise ConnectionResetError("no answer")
    answer = json.loads(line)
    if "error" in answer:
        raise Refused(answer["error"]["message"])
    return answer["result"]


def with_addresses_of_localhost(folder, *addresses):
    """A command that runs a program for which `localhost` has these addresses. Needs root."""
    hosts = folder / "hosts"
    hosts.write_text("".join(f"{address} localhost\n" for address in addresses))
    return ("unshare", "--mount", "sh", "-c", f'mount --bind {hosts} /etc/hosts && exec "$0" "$@"')


class Daemon:
    def __init__(self, folder, sockets, config, name="thermocompd"):
        self.folder = folder
        self.config = folder / (name + ".toml")
        self.history = folder / "history.db"
        self.state = folder / "state.json"
        self.socket = sockets / "status.sock"
        self.log = folder / (name + ".log")
        self.process = None
        self.environment = {}  # in addition to the test's own
        self.wrapper = ()      # a command that runs the daemon
        self.write_config(config)

    def write_config(self, text):
        own = (f'state_file = "{self.state}"\n', f'file = "{self.history}"\n',
               f'[socket]\npath = "{self.socket}"\n')
        self.config.write_text(text.replace("@STATE@\n", own[0]).replace("@HISTORY@\n", own[1]) +
                               own[2])

    def start(self, wait=True):
        self.log_start = self.log.stat().st_size if self.log.exists() else 0
        with self.log.open("a") as log:
            self.process = subprocess.Popen([*self.wrapper, str(BIN / "thermocompd"), str(self.config)],
                                            stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                            cwd=self.folder,
                                            env={**os.environ, **self.environment})
        if wait:
            eventually(lambda: self.answers(), "the daemon is ready")
        return self

    def log_text(self):
        with self.log.open() as log:
            log.seek(self.log_start)
            return log.read()

    def answers(self):
        assert self.process.poll() is None, "the daemon ended:\n" + self.log_text()
        if "ready: " not in self.log_text():
            return False
        with contextlib.suppress(OSError):
            return self.call("status")["mode"]
        return False

    def call(self, method, **params):
        return call(self.socket, method, **params)

    def status(self):
        return self.call("status")

    def wait_for_mode(self, mode):
        return eventually(lambda: self.status()["mode"] == mode and self.status(), "mode " + mode)

    def axis(self, name="z"):
        return next(axis for axis in self.status()["axes"] if axis["name"] == name)

    def wait_for_offset(self, offset_um, tolerance_um=0.01, name="z"):
        """The timeout restarts with each um of approach: the duration is not tested here."""
        def beside():
            return abs(self.axis(name)["offset"] - offset_um)

        nearest = beside()
        while nearest > tolerance_um:
            try:
                eventually(lambda: beside() <= max(tolerance_um, nearest - 1.0),
                           f"offset {offset_um} um from {nearest:.3f} um beside it")
            except AssertionError as failed:
                raise AssertionError(f"{failed}\n{self.cli('status')[1]}") from None
            nearest = beside()

    def cli(self, *arguments):
        """thermocomp with this daemon's socket: (exit status, stdout, stderr)."""
        return run_tool("--socket", self.socket, *arguments)

    def hang_up(self):
        self.process.send_signal(signal.SIGHUP)

    def kill(self):
        """Like a power cut, for this process."""
        self.process.kill()
        self.process.wait(PATIENCE_S)

    def end(self):
        """Like systemd; the exit status must be 0."""
        self.process.send_signal(signal.SIGTERM)
        assert self.process.wait(PATIENCE_S) == 0, self.log_text()

    def committed(self):
        mark = time.monotonic_ns()

        def through():
            with contextlib.closing(sqlite3.connect(self.history)) as base:
                row = base.execute("SELECT grid_start_ns + period_ns * last_cycle FROM segment "
                                   "ORDER BY id DESC LIMIT 1").fetchone()
            return row and row[0] > mark

        eventually(through, "a commit")


def run_tool(*arguments):
    done = subprocess.run([str(BIN / "thermocomp"), *map(str, arguments)], capture_output=True,
                          text=True, timeout=240)
    return done.returncode, done.stdout, done.stderr


class Simulator:
    def __init__(self, folder, machine, *options):
        self.folder = folder
        self.machine = folder / "machine.toml"
        self.machine.write_text(machine)
        self.log = (folder / "thermocomp-sim.log").open("a")
        self.process = subprocess.Popen(
            [str(BIN / "thermocomp-sim"), str(self.machine), *map(str, options)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self.log, text=True,
            cwd=folder)
        line = self.process.stdout.readline()
        assert line, "no ready line: " + (folder / "thermocomp-sim.log").read_text()
        self.ready = json.loads(line)

    def port(self, name):
        return self.ready["ports"][name]

    def connect(self, name):
        return socket.create_connection(("127.0.0.1", self.port(name)), timeout=PATIENCE_S)

    def alive(self):
        return self.process.poll() is None

    def wait(self, patience_s):
        out, _ = self.process.communicate(timeout=patience_s)
        assert self.process.returncode == 0, (self.folder / "thermocomp-sim.log").read_text()
        return out

    def kill(self):
        self.process.kill()
        self.process.communicate(timeout=PATIENCE_S)

    def end(self):
        """Stops it as an operator would; returns the remaining output."""
        self.process.terminate()
        return self.wait(PATIENCE_S)


class Lab:
    """Starts processes in one folder and ends all of them."""

    def __init__(self, folder):
        self.folder = folder
        # A socket's path is limited to 107 characters; pytest's folders may be longer.
        self.sockets = pathlib.Path(tempfile.mkdtemp(prefix="tc"))
        self.started = []

    def simulator(self, machine, *options):
        self.started.append(Simulator(self.folder, machine, *options))
        assert not self.started[-1].ready["unavailable"], self.started[-1].ready
        return self.started[-1]

    def daemon(self, config, name="thermocompd"):
        """Not yet started."""
        self.started.append(Daemon(self.folder, self.sockets, config, name))
        return self.started[-1]

    def also_end(self, thing):
        self.started.append(thing)
        return thing

    def end(self):
        for thing in reversed(self.started):
            process = getattr(thing, "process", None)
            if process is None:
                if hasattr(thing, "close"):
                    thing.close()
            elif process.poll() is None:
                process.kill()
                process.wait(PATIENCE_S)
        shutil.rmtree(self.sockets, ignore_errors=True)
        for log in self.folder.glob("*.log"):
            output = log.read_text(errors="replace")
            for finding in ("Sanitizer: ", "runtime error: ", "broken promise: "):
                assert finding not in output, output


def read_columns(path):
    """{column: [numbers]} of a run file; a missing value is NaN."""
    with open(path, newline="") as text:
        rows = csv.reader(line for line in text if not line.startswith("#"))
        header = next(rows)
        values = [[float(field) if field else math.nan for field in row] for row in rows]
    return {name: [row[i] for row in values] for i, name in enumerate(header)}


def replay(history, out):
    """Exact replay: (exit status, columns, stderr)."""
    status, _, output = run_tool("replay", history, "-o", out)
    return status, read_columns(out) if status in (0, 1) else {}, output


def first_cycle_s(history):
    """CLOCK_MONOTONIC at time_s = 0 of a replay."""
    with contextlib.closing(sqlite3.connect(history)) as base:
        start, period, first = base.execute(
            "SELECT grid_start_ns, period_ns, first_cycle FROM segment ORDER BY id LIMIT 1"
        ).fetchone()
    return 1e-9 * (start + period * first)


def count_rows(history):
    """Counts of committed (segments, chunks, records)."""
    with contextlib.closing(sqlite3.connect(history)) as base:
        assert base.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        segments = base.execute("SELECT count(*) FROM segment").fetchone()[0]
        chunks, records = base.execute("SELECT count(*), sum(count) FROM chunk").fetchone()
    return segments, chunks, records


def same_bits(columns):
    """Compares every pair of columns *_offset_um and *_recorded_um as numbers (texts are the
    shortest that restore the same bits): (compared, different)."""
    compared = different = 0
    for name, values in columns.items():
        if not name.endswith("_offset_um"):
            continue
        recorded = columns[name[:-len("_offset_um")] + "_recorded_um"]
        for ours, theirs in zip(values, recorded):
            compared += 1
            same = (math.isnan(ours) and math.isnan(theirs)) or (
                ours == theirs and math.copysign(1.0, ours) == math.copysign(1.0, theirs))
            different += not same
    return compared, different


def assert_replays_exactly(history, out):
    """Checks the statement of `thermocomp replay` and its columns. Returns the columns."""
    status, columns, output = replay(history, out)
    print(output.strip())
    assert status == 0, output
    compared, different = same_bits(columns)
    assert compared > 0 and different == 0
    assert f" {compared} offsets compared, 0 differ" in output
    return columns
