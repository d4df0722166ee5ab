"""The main thread never blocks: with a blocked disk, log, journal, name service or systemd, the
watchdog is fed within a second, clients are answered, `disable` and SIGTERM are obeyed."""

import contextlib
import fcntl
import json
import os
import pathlib
import socket
import subprocess
import time

import pytest

from lab import BIN, PATIENCE_S, Refused, eventually, run_tool
from plain_devices import MODEL, Machine
from service_manager import Metronome, ServiceManager, largest_gap_s

HERE = pathlib.Path(__file__).resolve().parent
PIPE_BYTES = 4096
CLIENT_S = 2.0


@pytest.fixture
def manager(lab):
    return lab.also_end(ServiceManager(lab.sockets / "notify"))


class Watched:
    """A machine whose daemon's delays are measured together with those of this computer."""

    def __init__(self, lab, manager, *standing):
        self.manager = manager
        self.stands = lab.folder / "stands"
        self.machine = Machine(lab)
        self.daemon = self.machine.daemon
        self.daemon.environment = dict(manager.environment)
        if standing:
            self.daemon.environment.update({
                "THERMOCOMP_STANDS": str(self.stands), "THERMOCOMP_STANDING": ",".join(standing),
                "LD_PRELOAD": os.environ["THERMOCOMP_STANDING_SYSTEM"],
                "ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0"})
        self.metronome = lab.also_end(Metronome())

    def start(self):
        self.machine.start()
        self.begin = time.monotonic()
        self.answers_s = []

    def ask(self, method="status"):
        begun = time.monotonic()
        try:
            return self.daemon.call(method)
        except Refused as refusal:
            return str(refusal)
        finally:
            self.answers_s.append(time.monotonic() - begun)

    def ask_for(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.ask()
            time.sleep(0.05)

    def judge(self):
        end = time.monotonic()
        late_s = self.metronome.lateness_s(self.begin, end)
        gap_s = largest_gap_s(self.manager.times_of("WATCHDOG=1"), self.begin, end)
        print(f"watchdog fed at least every {gap_s:.2f} s, slowest of {len(self.answers_s)} "
              f"answers {max(self.answers_s):.2f} s, this computer late by {late_s:.2f} s")
        assert gap_s <= 1.0 + 2 * late_s
        assert max(self.answers_s) <= CLIENT_S + 2 * late_s

    def end(self, within_s):
        begun = time.monotonic()
        self.daemon.end()
        took_s = time.monotonic() - begun
        print(f"ended in {took_s:.2f} s")
        assert took_s <= within_s + 2 * self.metronome.lateness_s(begun, time.monotonic())


def warm(watched):
    """Another offset each time, so that there is something to save."""
    watched.machine.warm_by(3.0 + time.monotonic() % 5.0)


def test_a_disk_that_takes_seconds_to_save_the_state(lab, manager):
    watched = Watched(lab, manager, "fsync:state.json")
    watched.start()
    watched.stands.touch()
    warm(watched)
    output = watched.ask("disable")
    assert "carried out, but not saved" in output and "does not answer" in output, output
    assert watched.ask()["mode"] == "disabled"
    eventually(lambda: any("does not answer" in warning for warning in watched.ask()["warnings"]),
               "the status says so")
    watched.ask_for(2.0)
    watched.judge()
    watched.stands.unlink()
    eventually(lambda: json.loads(watched.daemon.state.read_text())["enabled"] is False,
               "it is saved as soon as the disk answers")
    eventually(lambda: not watched.ask()["warnings"], "the warning ends")
    assert watched.ask("enable") == {"done": True}
    # At the end the daemon waits for the disk, with a limit.
    watched.stands.touch()
    warm(watched)
    time.sleep(0.5)
    watched.end(within_s=12.0)


def test_a_disk_that_takes_seconds_to_commit_the_history(lab, manager):
    watched = Watched(lab, manager, "fsync:history.db")
    watched.start()
    watched.daemon.committed()
    watched.stands.touch()
    watched.ask_for(3.0)
    assert watched.ask("disable") == {"done": True}
    watched.judge()
    watched.end(within_s=10.0)
    assert "uncommitted records are lost" in watched.daemon.log_text()


def test_files_on_a_disk_that_does_not_answer_hold_a_reload_and_nothing_else(lab, manager):
    watched = Watched(lab, manager, "open:model.toml")
    watched.start()
    watched.stands.touch()
    watched.daemon.hang_up()
    watched.ask_for(2.0)
    assert "a reload is in progress" in watched.ask("reload")
    assert watched.ask("disable") == {"done": True}
    watched.judge()
    watched.stands.unlink()
    eventually(lambda: "reloaded: " in watched.daemon.log_text(), "the reload goes on")
    watched.end(within_s=5.0)


def test_a_name_service_that_does_not_answer(lab, manager):
    watched = Watched(lab, manager, "groups")
    watched.start()
    watched.stands.touch()
    watched.ask_for(8.0)
    assert watched.ask("disable") == {"done": True}
    watched.judge()
    watched.stands.unlink()
    watched.end(within_s=5.0)


def test_a_large_model_is_taken_within_a_second(lab, manager):
    watched = Watched(lab, manager)
    watched.start()
    watched.machine.model.write_text(MODEL + "".join(
        f'[[term]]\nkind = "thermal_lag"\nsubject = "column_degC"\ntau_s = {1 + i}\n'
        "gain_um_per_K = { z_um = 0.0001 }\n" for i in range(1000)))
    begun = time.monotonic()
    answer = watched.daemon.call("reload")
    took_s = time.monotonic() - begun
    late_s = watched.metronome.lateness_s(begun, time.monotonic())
    print(f"1000 terms taken in {took_s:.2f} s")
    assert answer["done"] and took_s <= 1.5 + 3 * late_s
    watched.ask_for(1.0)
    watched.judge()
    watched.end(within_s=5.0)


def warns_of_log(watched):
    return any("the log is not read" in warning for warning in watched.ask()["warnings"])


def fill_log(watched):
    """Each SIGHUP finds a configuration whose errors take 100 kB to report."""
    watched.daemon.write_config(watched.machine.config + "".join(
        f"no_such_key_{i}_{'x' * 4000} = 1\n" for i in range(120)))


    def is_full():
        watched.daemon.hang_up()
        watched.ask_for(0.2)
        return warns_of_log(watched)
    eventually(is_full, "lines are lost", patience_s=4 * PATIENCE_S)
    for _ in range(5):
        watched.daemon.hang_up()
        watched.ask_for(0.2)


def obeys(watched):
    for method, mode in (("disable", "disabled"), ("enable", "compensating"),
                         ("disable", "disabled")):
        assert watched.ask(method) == {"done": True}
        eventually(lambda: watched.ask()["mode"] == mode, mode)


def start_with_log_in(watched, log, program=()):
    """Like Daemon.start(), whose log is a file that never blocks."""
    daemon = watched.daemon
    daemon.process = subprocess.Popen(
        [*program, str(BIN / "thermocompd"), str(daemon.config)], stdin=subprocess.DEVNULL,
        stdout=log, stderr=log, cwd=daemon.folder, env={**os.environ, **daemon.environment})

    def compensates():
        with contextlib.suppress(OSError):
            return daemon.call("status")["mode"] == "compensating"
        return False
    eventually(compensates, "it compensates")
    watched.begin = time.monotonic()
    watched.answers_s = []


def end_without_log(watched):
    begun = time.monotonic()
    watched.daemon.process.terminate()
    assert watched.daemon.process.wait(PATIENCE_S) == 0
    took_s = time.monotonic() - begun
    print(f"ended in {took_s:.2f} s")
    assert took_s <= 6.0 + 2 * watched.metronome.lateness_s(begun, time.monotonic())


def test_an_unread_log_pipe(lab, manager):
    watched = Watched(lab, manager)
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    start_with_log_in(watched, writing)
    fill_log(watched)
    obeys(watched)
    watched.ask_for(1.0)
    watched.judge()
    # Once the journal is read, the rest arrives with the number of lost messages.
    os.set_blocking(reading, False)
    text = b""

    def read_on():
        nonlocal text
        with contextlib.suppress(BlockingIOError):
            while part := os.read(reading, 1 << 16):
                text += part
        return b"lines of the log were lost" in text
    eventually(read_on, "the log says that lines were lost")
    eventually(lambda: read_on() and not warns_of_log(watched), "the warning ends")
    eventually(lambda: [event["kind"] for event in watched.daemon.call("events")["events"]
                        if event["subject"] == "log"] == ["fault", "recovery"], "and its events")
    # And not again.
    fill_log(watched)
    end_without_log(watched)
    os.close(reading)
    os.close(writing)


def test_no_line_of_a_log_that_is_read_is_lost(lab, manager):
    watched = Watched(lab, manager)
    watched.start()
    for _ in range(20):
        watched.ask("disable")
        watched.ask("enable")
    watched.daemon.end()
    log = watched.daemon.log_text()
    assert log.count("operator: disable") == 20 and log.count("operator: enable") == 20
    assert "stopped; " in log.splitlines()[-1] and "were lost" not in log


def test_an_unread_journal(lab, manager):
    namespace = ("unshare", "--mount", "--map-root-user")
    if subprocess.run([*namespace, "true"], capture_output=True).returncode != 0:
        pytest.skip("this kernel gives no mount namespace")
    watched = Watched(lab, manager)
    start_with_log_in(watched, subprocess.DEVNULL,
                      (*namespace, "/usr/bin/python3", str(HERE / "unread_journal.py")))
    fill_log(watched)
    obeys(watched)
    watched.ask_for(2.0)
    watched.judge()
    end_without_log(watched)


def test_a_service_manager_that_does_not_read(lab):
    deaf = lab.also_end(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
    deaf.bind(str(lab.sockets / "notify"))
    machine = Machine(lab)
    machine.daemon.environment = {"NOTIFY_SOCKET": str(lab.sockets / "notify"),
                                  "WATCHDOG_USEC": "1000000"}
    daemon = machine.start()
    slowest_s = 0.0
    end = time.monotonic() + 8.0  # it keeps ten messages, one per third of a second
    while time.monotonic() < end:
        begun = time.monotonic()
        daemon.status()
        slowest_s = max(slowest_s, time.monotonic() - begun)
        time.sleep(0.05)
    assert slowest_s < CLIENT_S
    assert daemon.call("disable") == {"done": True}
    # Missed messages are reported as soon as it reads.
    deaf.settimeout(PATIENCE_S)
    while b"stopping" not in (shown := deaf.recv(4096)).lower():
        if b"WATCHDOG" in shown and daemon.process.poll() is None:
            daemon.process.terminate()
    assert daemon.process.wait(PATIENCE_S) == 0


def test_pipes_next_to_state_and_history(lab, manager):
    watched = Watched(lab, manager)
    os.mkfifo(str(watched.daemon.state) + ".new")
    os.mkfifo(str(watched.daemon.history) + "-journal")
    watched.start()
    assert watched.ask("disable") == {"done": True}
    assert json.loads(watched.daemon.state.read_text())["enabled"] is False
    history = watched.ask()["history"]
    assert not history["working"] and "must be a regular file" in history["last_error"]
    # Instead of the model's file too.
    watched.machine.model.unlink()
    os.mkfifo(watched.machine.model)
    assert "must be a regular file" in watched.ask("reload")
    watched.ask_for(1.0)
    watched.judge()
    watched.end(within_s=5.0)


@pytest.mark.parametrize("command", [("history", "check"), ("export",), ("events",), ("report",),
                                     ("replay",)])
def test_a_history_that_is_a_pipe_is_refused_at_once(lab, command):
    pipe = lab.folder / "pipe.db"
    os.mkfifo(pipe)
    out = () if command[-1] in ("check", "events") else ("-o", str(lab.folder / "out"))
    begun = time.monotonic()
    status, _, output = run_tool(*command, pipe, *out)
    assert status == 2 and "must be a regular file" in output, (status, output)
    assert time.monotonic() - begun < 10.0
