"""Allowed and forbidden operations of the service."""

import json
import pathlib

import service
from service import STATE, UNIT, run

PROBE = pathlib.Path("/opt/service-test/guest/probe.py")


def probe():
    """Possible operations in the unit's sandbox, tried by a program started before the daemon."""
    service.drop_in("probe", f"[Service]\nExecStartPre=/usr/bin/python3 {PROBE}\n")
    run("systemctl", "restart", UNIT)
    service.drop_in("probe", None)
    return json.loads((STATE / "probe.json").read_text())


def test_exposure_is_at_most_2_5(running):
    figure, table = service.exposure()
    print(table.splitlines()[-1])
    assert figure <= 2.5, table


def test_the_sandbox_lets_through_what_is_needed_and_nothing_else(running):
    could = probe()
    print(json.dumps(could))
    for needed in ("write state", "read configuration", "tcp socket", "unix socket", "fifo",
                   "lock memory"):
        assert could[needed] == "", f"{needed}: {could[needed]}"
    for refused in ("write configuration", "write /usr", "read /root", "packet socket",
                    "netlink socket", "new namespace", "kernel log", "set the clock",
                    "writable and executable memory", "change owner", "see other processes"):
        assert could[refused] != "", refused


def test_a_sites_addresses_narrow_it_further(running):
    text = (service.FILES / "site.conf").read_text()
    service.drop_in("site", text.replace("192.168.10.0/24", "127.0.0.0/8"))
    run("systemctl", "restart", UNIT)
    service.wait_for_mode("compensating")
    figure, table = service.exposure()
    print(table.splitlines()[-1])
    service.drop_in("site", None)
    run("systemctl", "restart", UNIT)
    service.wait_for_mode("compensating")
    assert figure < service.exposure()[0]
