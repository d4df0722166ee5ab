"""Recorded data arrive in the store completely and once, whatever happens on the way."""

import os
import pathlib
import shutil
import socket
import sqlite3
import subprocess
import tempfile
import threading

import pytest

from fleet_lab import Machine, eventually
from postgres import Postgres


@pytest.fixture(scope="module")
def day(server, tmp_path_factory):
    """A history of twelve hours, copied by the machines."""
    from fleet_lab import Store
    machine = Machine(Store(server, tmp_path_factory.mktemp("day"), "day"), "first")
    machine.expected = machine.record(hours_ago=20, hours=12)
    machine.means = machine.recorded()
    return machine


@pytest.fixture
def machine(store, day):
    made = Machine(store, "mill_1", history=day.history)
    made.expected, made.means = dict(day.expected), dict(day.means)
    yield made
    made.end()


def assert_all_there_once(machine):
    taken = machine.taken()
    assert taken.keys() == machine.means.keys()
    for begin, means in machine.means.items():
        for name, value in means.items():
            assert taken[begin][name] == pytest.approx(value, rel=1e-5, abs=1e-5), (begin, name)
    assert machine.count("probing") == machine.expected["probings"]
    assert machine.count("event") == machine.expected["events"]


def test_everything_recorded_arrives_once(machine):
    machine.send()
    assert len(machine.means) > 4000
    assert_all_there_once(machine)
    # Again: nothing is sent.
    before = machine.progress()
    machine.send()
    assert machine.progress() == before == (len(machine.means), 0, 0)
    # If the store has lost its progress, nothing is stored twice.
    machine.store.ask("UPDATE fleet.uplink SET segment = 0, event_run = 0, event_number = 0")
    machine.send()
    assert_all_there_once(machine)
    assert machine.progress() == (2 * len(machine.means), 0, len(machine.means))


def test_probings_have_the_models_value(machine):
    machine.send()
    assert machine.store.value("SELECT count(*) FROM fleet.probing WHERE modelled_um IS NULL") == "0"
    assert machine.store.value("SELECT max(abs(modelled_um)) > 1 FROM fleet.probing") == "t"
    assert machine.store.value("SELECT content ~ 'matrix_um_per_K' FROM fleet.setup "
                               "JOIN fleet.document ON checksum = model") == "t"


def test_another_start_of_the_daemon_is_followed(machine):
    machine.send()
    more = machine.record(hours_ago=5, hours=2)
    machine.means = machine.recorded()
    machine.expected = {name: machine.expected[name] + more[name] for name in more}
    machine.send()
    assert_all_there_once(machine)
    assert machine.progress() == (len(machine.means), 0, 0)


def test_a_new_history_is_sent_from_its_beginning(machine):
    machine.send()
    for file in machine.folder.glob("history.db*"):
        file.unlink()
    more = machine.record(hours_ago=5, hours=1)
    assert "from its beginning" in machine.send()
    machine.means.update(machine.recorded())
    machine.expected = {name: machine.expected[name] + more[name] for name in more}
    assert_all_there_once(machine)


def test_a_history_of_other_sensors_replaces_one_that_is_being_sent(store):
    machine, other = Machine(store, "mill_1"), Machine(store, "mill_2")
    for file in ("thermocompd.toml", "model.toml"):
        text = (other.folder / file).read_text()
        (other.folder / file).write_text(text.replace("column", "ram"))
    other.record(hours_ago=2, hours=0.5)
    machine.record(hours_ago=5, hours=0.5)
    machine.start()
    rows = len(machine.recorded())
    eventually(lambda: machine.count("sample") == rows, "the first history is sent")
    other.history.rename(machine.history)  # its only segment has the number of the one before
    rows += len(machine.recorded())
    eventually(lambda: machine.count("sample") == rows, "so is the other")
    columns = machine.store.ask("SELECT array_to_string(columns, ' ') FROM fleet.setup ORDER BY number")
    assert ["column_degC" in names for [names] in columns] == [True, False]
    machine.end()


def test_a_server_that_is_killed_loses_nothing(machine):
    server = machine.store.server
    machine.start()
    for share in (0.1, 0.4, 0.7):
        eventually(lambda: machine.count("sample") > share * len(machine.means), "rows arrive")
        server.stop("immediate")
        server.start()
    eventually(lambda: machine.count("sample") == len(machine.means), "all rows")
    eventually(lambda: machine.count("event") == machine.expected["events"], "all events")
    # Said only when the call that sent the last rows returns.
    eventually(lambda: "sending again" in machine.log.read_text(), "the end of the last outage")
    machine.end()
    assert_all_there_once(machine)


class Cable:
    """Forwards bytes until it is pulled."""

    def __init__(self, port):
        self.to = port
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.links, self.plugged, self.passed = [], True, 0
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                near, _ = self.listener.accept()
            except OSError:
                return
            if not self.plugged:
                near.close()
                continue
            far = socket.create_connection(("127.0.0.1", self.to))
            self.links += [near, far]
            threading.Thread(target=self.carry, args=(near, far), daemon=True).start()
            threading.Thread(target=self.carry, args=(far, near), daemon=True).start()

    def carry(self, source, target):
        try:
            while data := source.recv(4096):
                target.sendall(data)
                self.passed += len(data)
        except OSError:
            pass
        for link in (source, target):
            try:
                link.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def pull(self):
        self.plugged = False
        for link in self.links:
            try:
                link.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def plug(self):
        self.plugged = True


def test_a_cable_that_is_pulled_loses_nothing(machine):
    cable = Cable(machine.store.server.port)
    machine.configure(machine.store.remote("machine_mill_1", port=cable.port))
    machine.start()
    for share in (0.2, 0.6):
        eventually(lambda: machine.count("sample") > share * len(machine.means), "rows arrive")
        cable.pull()
        eventually(lambda: machine.log.read_text().count("not sent") > 0, "it is noticed")
        cable.plug()
    eventually(lambda: machine.count("sample") == len(machine.means), "all rows")
    eventually(lambda: machine.count("event") == machine.expected["events"], "all events")
    machine.end()
    cable.listener.close()
    assert_all_there_once(machine)


def test_a_wrong_clock_loses_only_its_own_rows_and_is_reported(store):
    machine = Machine(store, "mill_1")
    machine.expected = machine.record(hours_ago=20, hours=3, clock=(3600, 400 * 86400))
    machine.means = machine.recorded()
    now = eventually(lambda: int(store.value("SELECT extract(epoch FROM now())::bigint")), "a time")
    ahead = {begin for begin in machine.means if begin > now}
    assert 50 <= len(ahead) <= 62  # of 10 min, from one commit to another
    assert "rows refused" in machine.send()
    taken = machine.taken()
    assert taken.keys() == machine.means.keys() - ahead
    assert machine.progress() == (len(machine.means), len(ahead), 0)
    # Only those 10 minutes, whose time is unknown, are missing from the machine's rows.
    assert 3 * 360 - 63 <= len(taken) <= 3 * 360 - 50
    assert "mill_1" in store.fleet("status") and f"{len(ahead)} refused" in store.fleet("status")


@pytest.mark.skipif(os.geteuid() != 0, reason="a small file system needs root")
def test_a_disk_that_is_full_loses_nothing(tmp_path, day):
    from fleet_lab import Store
    place = pathlib.Path(tempfile.mkdtemp(prefix="disk"))
    place.chmod(0o755)
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=200m,mode=0755", "tmpfs", place]).returncode:
        pytest.skip("a tmpfs cannot be mounted here")
    server = machine = None
    try:
        server = Postgres(place)
        server.configure(max_wal_size="'32MB'", min_wal_size="'32MB'")
        server.require_tls()
        server.start()
        store = Store(server, tmp_path, "full_disk")
        machine = Machine(store, "mill_1", history=day.history)
        machine.expected, machine.means = day.expected, day.means
        ballast = place / "ballast"
        left = shutil.disk_usage(place).free
        with ballast.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, left - 600_000)
        machine.start()
        eventually(lambda: "not sent" in machine.log.read_text(), "the disk is full")
        ballast.unlink()
        server.stop("immediate")  # it may have ended by itself
        server.start()
        eventually(lambda: machine.count("sample") == len(machine.means), "all rows")
        eventually(lambda: machine.count("event") == machine.expected["events"], "all events")
        machine.end()
        assert "No space left" in machine.log.read_text() + (server.folder / "log").read_text()
        assert_all_there_once(machine)
    finally:
        if machine and machine.process:
            machine.process.kill()
            machine.process.wait()
        if server:
            server.end()
        # Children of a server that was stopped at once may still hold a file.
        eventually(lambda: subprocess.run(["umount", place], check=False).returncode == 0, "umount")
        place.rmdir()


def test_many_uplinks_at_once(store, day):
    machines = [Machine(store, f"mill_{i}", history=day.history) for i in range(12)]
    for machine in machines:
        machine.start()
    for machine in machines:
        eventually(lambda: machine.count("sample") == len(day.means) and
                   machine.count("event") == day.expected["events"], "all rows of " + machine.name, patience_s=120)
    for machine in machines:
        machine.end()
        machine.expected, machine.means = day.expected, day.means
        assert machine.progress() == (len(day.means), 0, 0)
    assert_all_there_once(machines[7])


def test_without_tls_only_if_configured(machine):
    server = machine.store.server
    plain = f"host=localhost port={server.port} dbname={machine.store.name}"
    machine.configure(plain)  # no authority: the certificate cannot be verified
    assert "certificate" in machine.send(status=1)
    machine.configure(f"{plain} sslmode=disable")
    assert "no encryption" in machine.send(status=1)
    machine.configure(f"{plain} sslrootcert={server.authority}")
    machine.send()
    assert_all_there_once(machine)


def test_a_damaged_segment_loses_only_itself_and_is_reported(machine):
    base = sqlite3.connect(machine.history)
    [segment] = base.execute("SELECT id FROM segment ORDER BY id LIMIT 1 OFFSET 1").fetchone()
    base.execute("UPDATE chunk SET records = x'00' WHERE segment = ? AND number % 50 = 7", [segment])
    base.commit()
    base.close()
    machine.send()
    assert 0.7 * len(machine.means) < machine.count("sample") < len(machine.means) + 1
    assert int(machine.store.value("SELECT damaged FROM fleet.uplink")) > 0


def test_a_history_that_cannot_be_read_does_not_stop_the_others(machine):
    settings = machine.folder / "uplink.toml"
    unreadable = machine.folder / "other.db"
    unreadable.write_text("no history")
    settings.write_text(settings.read_text().replace("history = [", f'history = ["{unreadable}", '))
    assert f"not sent: {unreadable}" in machine.send(status=1)
    assert_all_there_once(machine)


def test_two_uplinks_with_one_role_are_reported(machine):
    machine.start()
    eventually(lambda: machine.count("sample") == len(machine.means), "all rows")
    # What another computer with a copy of uplink.toml does.
    machine.store.ask("UPDATE fleet.uplink SET segment_wall_ns = segment_wall_ns + 1")
    machine.record(hours_ago=5, hours=1)
    eventually(lambda: "another uplink sends" in machine.log.read_text(), "it is reported")
    machine.means.update(machine.recorded())
    eventually(lambda: machine.count("sample") == len(machine.means), "its rows arrive all the same")


def test_a_configuration_is_refused_with_every_problem(machine):
    (machine.folder / "uplink.toml").write_text(
        'format = 1\nmachine = "x"\nstore = "nonsense"\ncpu_percent_max = 0\npassword_file = "none"\nperiod = 3\n')
    output = machine.send(status=2)
    for what in ('store', 'cpu_percent_max', 'password_file', 'period'):
        assert what in output, output
