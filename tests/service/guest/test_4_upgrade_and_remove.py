"""Upgrades, removal, purge."""

import gzip
import pathlib
import pwd
import re
import shutil

import pytest

import service
import test_1_install_and_start as first
from lab import eventually
from service import CONFIG, HISTORY, STATE, UNIT, run, show


NEWER = "0.2.1~test"
OLDER = service.package("thermocomp")
ENTRY = f"""thermocomp ({NEWER}) bookworm; urgency=medium

  * The next version.

 -- thermocomp maintainers <maintainers@thermocomp.example.org>  Fri, 27 Nov 2026 12:00:00 +0000

"""


@pytest.fixture(scope="module")
def newer():
    """The same programs as the next version, with a longer example."""
    folder = service.FILES / "newer"
    run("dpkg-deb", "-R", OLDER, folder)
    control = folder / "DEBIAN" / "control"
    control.write_text(re.sub(r"(?m)^Version: .*$", f"Version: {NEWER}", control.read_text()))
    changelog = folder / "usr/share/doc/thermocomp/changelog.gz"
    changelog.write_bytes(gzip.compress(ENTRY.encode() + gzip.decompress(changelog.read_bytes())))
    example = folder / "etc/thermocomp/thermocompd.toml.example"
    example.write_text(example.read_text() + "# a line of the next version\n")
    run("dpkg-deb", "-b", folder, service.FILES / "newer.deb")
    shutil.rmtree(folder)
    return service.FILES / "newer.deb"


def installed_version():
    return run("dpkg-query", "-W", "-f", "${Version}", "thermocomp").stdout


def install(package):
    done = run("dpkg", "--force-confold", "-i", package)
    print(done.stderr.strip())
    return done.stderr


def config_of(machine, shown):
    config = machine.config()
    return config if shown else re.sub("(?m)^applied = .*\n", "", config)


@pytest.fixture(params=["applied is read back", "nothing can be read back"])
def known_machine(request, running):
    """Without a read-back only last-sent record and state file hold the axis's offset."""
    shown = request.param == "applied is read back"
    service.drop_in("planted", None)
    service.write_config(config_of(running, shown))
    if not shown:
        running.controller.refused = {3, 4}
    run("systemctl", "restart", UNIT)
    service.wait_for_mode("compensating")
    running.settled_at(9.0)
    yield running
    running.controller.refused = set()
    service.write_config(running.config())
    run("systemctl", "restart", UNIT)
    service.wait_for_mode("compensating")


def change_over(machine, package, from_um, to_um):
    """Installs the package while the axis moves; prints the effect on the controller."""
    pid, began, chunks = service.main_pid(), machine.count(), service.committed_chunks()
    kept = [CONFIG.read_bytes(), HISTORY.stat().st_ino,
            [each["reference_degC"] for each in service.status()["inputs"]]]
    machine.warm_by(to_um)
    eventually(lambda: abs(machine.controller.applied_um() - from_um) > 2.0, "on the way")
    install(package)
    now = service.wait_for_mode("compensating")
    assert service.main_pid() not in (0, pid)
    machine.settled_at(to_um)

    orders = machine.orders_since(began)
    pauses = [later[0] - earlier[0] for earlier, later in zip(orders, orders[1:])]
    steps = [abs(later[1] - earlier[1]) for earlier, later in zip(orders, orders[1:])]
    held = max(range(len(pauses)), key=pauses.__getitem__)
    print(f"{len(orders)} orders; held {pauses[held]:.2f} s at {orders[held][1]:.3f} um, then "
          f"{orders[held + 1][1]:.3f} um; largest step {max(steps):.3f} um, at most "
          f"{max(step - service.SLEW_UM_PER_S * pause for step, pause in zip(steps, pauses)):.3f}"
          " um more than slew x time")
    # Late arrivals on a busy machine are excused; a leap at the start would be of many um.
    service.assert_slewed(orders)
    assert min(from_um, to_um) < orders[held][1] < max(from_um, to_um)
    # The longest pause may be the guest's own, during which the axis moved.
    assert steps[held] < service.SLEW_UM_PER_S * pauses[held] + 0.05, "it goes on from where the one before stopped"

    eventually(lambda: service.recorded_spans()[-1][1] > orders[-1][0], "all of it is committed")
    assert chunks <= service.committed_chunks()
    spans = service.recorded_spans()
    unrecorded = [at_s for at_s, _ in orders
                  if not any(first_s <= at_s <= last_s + 0.1 for first_s, last_s in spans)]
    print(f"{len(chunks)} committed parts before, {len(service.committed_chunks())} after; "
          f"{len(unrecorded)} orders that no row covers")
    assert unrecorded == []
    assert now["history"]["lost_records"] == 0, now["history"]
    print(run("thermocomp", "history", "check", HISTORY).stdout.strip().splitlines()[-1])
    assert [CONFIG.read_bytes(), HISTORY.stat().st_ino,
            [each["reference_degC"] for each in service.status()["inputs"]]] == kept


def test_an_upgrade_and_the_way_back_hold_the_offset_and_lose_nothing(known_machine, newer):
    change_over(known_machine, newer, 9.0, 30.0)
    assert installed_version() == NEWER
    change_over(known_machine, OLDER, 30.0, 9.0)
    assert installed_version() == OLDER.name.split("_")[1]
    output = run("thermocomp", "replay", HISTORY, "-o", service.FILES / "out.csv").stderr.strip()
    assert ", 0 differ" in output, output


def test_an_upgrade_keeps_what_the_site_has_written(running, newer):
    example = pathlib.Path("/etc/thermocomp/thermocompd.toml.example")
    example.write_text(example.read_text() + "# a line of the site\n")
    install(newer)
    assert "# a line of the site" in example.read_text()


def test_the_previous_daemon_continues_if_the_next_version_refuses_its_configuration(running, newer):
    pid = service.main_pid()
    CONFIG.write_text(running.config() + "colour = 1\n")
    output = install(newer)
    assert "colour" in output and "was not restarted" in output
    assert service.main_pid() == pid
    orders = running.count()
    running.settled_at(12.0)
    service.assert_slewed(running.orders_since(orders))
    service.write_config(running.config())
    install(newer)
    assert service.main_pid() not in (0, pid)
    service.wait_for_mode("compensating")


def test_an_upgrade_leaves_what_was_stopped_stopped(running, newer):
    run("systemctl", "stop", UNIT)
    run("dpkg", "--force-confold", "-i", newer)
    assert show("ActiveState") == "inactive"


def test_a_removal_stops_it_and_keeps_configuration_history_and_reference(running):
    reference = [each["reference_degC"] for each in service.status()["inputs"]]
    run("dpkg", "-r", "thermocomp")
    assert show("LoadState") in ("not-found", "masked")
    assert not pathlib.Path("/usr/bin/thermocompd").exists()
    assert not service.SOCKET.exists()
    assert CONFIG.exists() and HISTORY.exists() and (STATE / "state.json").exists()
    assert running.controller.applied_um() == pytest.approx(9.0, abs=0.01)
    # Installed and started again, it continues with its stored state.
    run("dpkg", "--force-confold", "-i", service.package("thermocomp"))
    assert show("ActiveState") == "inactive"
    service.start()
    assert [each["reference_degC"] for each in service.status()["inputs"]] == reference


def test_a_purge_leaves_nothing(running):
    run("dpkg", "-P", "thermocomp")
    with pytest.raises(KeyError):
        pwd.getpwnam("thermocomp")
    assert "thermocomp" not in pathlib.Path("/etc/group").read_text()
    assert "thermocomp" not in pathlib.Path("/etc/shadow").read_text()
    shutil.rmtree(service.DROP_INS, ignore_errors=True)  # ours
    backups = {"/etc/passwd-", "/etc/group-", "/etc/shadow-", "/etc/gshadow-", "/etc/.pwd.lock"}
    left = sorted(path for path in service.tree(*first.WATCHED)
                  if path not in first.before["tree"] and path not in backups and
                  not path.startswith(("/var/lib/dpkg", "/opt/service-test", "/var/lib/systemd")))
    assert left == []
    kept = pathlib.Path("/var/lib/systemd").rglob("*thermocomp*")
    assert sorted(map(str, kept)) == []
    assert not pathlib.Path("/run/thermocomp").exists()
