"""Upgrades, removal, purge."""

import pathlib
import pwd
import shutil

import pytest

import service
import test_1_install_and_start as first
from lab import eventually
from service import CONFIG, HISTORY, STATE, UNIT, run, show


@pytest.fixture(scope="module")
def newer():
    """The same package with a higher version."""
    folder = service.FILES / "newer"
    run("dpkg-deb", "-R", service.package("thermocomp"), folder)
    control = folder / "DEBIAN" / "control"
    text = control.read_text()
    version = next(line for line in text.splitlines() if line.startswith("Version: "))
    control.write_text(text.replace(version, version + "+upgrade"))
    example = folder / "etc/thermocomp/thermocompd.toml.example"
    example.write_text(example.read_text() + "# a line of the next version\n")
    run("dpkg-deb", "-b", folder, service.FILES / "newer.deb")
    shutil.rmtree(folder)
    return service.FILES / "newer.deb"


def test_an_upgrade_restarts_what_ran_without_a_jump_and_keeps_what_it_knew(running, newer):
    service.drop_in("planted", None)
    run("systemctl", "restart", UNIT)
    service.wait_for_mode("compensating")
    example = pathlib.Path("/etc/thermocomp/thermocompd.toml.example")
    example.write_text(example.read_text() + "# a line of the site\n")
    pid, orders, rows = service.main_pid(), running.count(), service.committed_rows()
    reference = [each["reference_degC"] for each in service.status()["inputs"]]
    run("dpkg", "--force-confold", "-i", newer)
    eventually(lambda: service.active() and service.main_pid() not in (0, pid), "a new daemon")
    service.wait_for_mode("compensating")
    eventually(lambda: len(running.orders_since(orders)) > 50, "orders")
    assert all(abs(order - 9.0) < 0.01 for _, order in running.orders_since(orders))
    assert service.committed_rows() >= rows
    assert [each["reference_degC"] for each in service.status()["inputs"]] == reference
    assert "# a line of the site" in example.read_text()
    assert CONFIG.exists()


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
    # Installed again it goes on with what it knew, once it is started.
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
