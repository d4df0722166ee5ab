"""The gateway's package and unit next to the daemon's: start, answers, sandbox, purge."""

import contextlib
import http.client
import json
import pathlib
import pwd
import re

import service
from lab import eventually
from service import CONFIG, run

UNIT = "thermocomp-gateway.service"
SETTINGS = CONFIG.parent / "gateway.toml"
PASSWORDS = CONFIG.parent / "gateway.passwords"
PORT = 8420  # also of a store's page
GATEWAY = 'format = 1\nmachine = "mill_3"\n[http]\n'
EXPOSURE_MAX = 1.5


def show(*names):
    text = run("systemctl", "show", UNIT, "-p", ",".join(names)).stdout
    values = dict(line.split("=", 1) for line in text.splitlines() if "=" in line)
    return values[names[0]] if len(names) == 1 else values


def ask(path):
    """(status, text); None if nothing listens."""
    with contextlib.suppress(OSError), contextlib.closing(
            http.client.HTTPConnection("127.0.0.1", PORT, timeout=20)) as link:
        link.request("GET", path)
        answer = link.getresponse()
        return answer.status, answer.read().decode()
    return None, ""


def metric(name):
    found = re.search(rf"^{name}(?:{{[^}}]*}})? (\S+)$", ask("/metrics")[1], re.MULTILINE)
    return float(found.group(1)) if found else None


def history_has_offsets():
    reported = json.loads(ask("/api/history?from=-60&points=20")[1])
    assert reported["damage"] == []
    return any(value is not None for value in reported["columns"]["z_offset_um"])


def test_installed_it_starts_nothing_before_it_is_configured(machine):
    run("dpkg", "-i", service.package("thermocomp"), service.package("thermocomp-gateway"))
    service.write_config(machine.config())
    machine.warm_by(0.0)
    service.start()
    machine.settled_at(9.0)
    run("systemctl", "start", UNIT)
    assert show("ActiveState", "ConditionResult") == {"ActiveState": "inactive", "ConditionResult": "no"}
    example = pathlib.Path("/usr/share/doc/thermocomp-gateway/examples/gateway.toml")
    assert run("thermocomp", "check", example).stdout.rstrip().endswith("OK")


def test_started_it_answers_with_the_daemons_status(machine):
    SETTINGS.write_text(GATEWAY)
    run("systemctl", "start", UNIT)
    assert show("ActiveState") == "active"
    eventually(lambda: metric("thermocomp_compensating") == 1.0, "the daemon is seen")
    assert abs(metric("thermocomp_axis_offset_meters") - 9e-6) < 1e-8
    status, page = ask("/")
    assert status == 200 and "<title>" in page
    # The history belongs to the daemon's user; its rows are readable once committed.
    eventually(history_has_offsets, "the history has rows")
    service.stop_and_forget()
    eventually(lambda: metric("thermocomp_up") == 0.0, "the daemon is missed")
    service.start()
    eventually(lambda: metric("thermocomp_up") == 1.0, "the daemon is back")


def test_it_may_read_the_report_that_the_timer_makes():
    SETTINGS.write_text(GATEWAY + 'report = "/var/lib/thermocomp/reports/week.html"\n')
    run("systemctl", "restart", UNIT)
    eventually(lambda: metric("thermocomp_up") == 1.0, "it answers")
    run("systemctl", "start", "thermocomp-report.service")
    status, page = ask("/report")
    assert status == 200 and "report on the thermal compensation" in page, page[:500]


def test_it_runs_without_rights_in_its_sandbox():
    pid = int(show("MainPID"))
    assert pathlib.Path(f"/proc/{pid}").stat().st_uid == pwd.getpwnam("thermocomp-gateway").pw_uid
    assert service.process_fact(pid, "NoNewPrivs") == "1"
    assert service.process_fact(pid, "Seccomp") == "2"
    assert int(service.process_fact(pid, "CapEff"), 16) == 0
    # Forbidden calls to the daemon fail: the socket checks the caller.
    asked = run("setpriv", "--reuid", "thermocomp-gateway", "--regid", "thermocomp-gateway", "--init-groups",
                "thermocomp", "disable", check=False)
    assert asked.returncode == 2, asked
    assert service.status()["enabled"]


def test_its_exposure_is_at_most_1_5():
    text = run("systemd-analyze", "security", UNIT, "--no-pager").stdout
    figure = float(re.search(rf"exposure level for {UNIT}: ([0-9.]+)", text).group(1))
    print(text.splitlines()[-1])
    assert figure <= EXPOSURE_MAX, text


def test_killed_it_is_started_again():
    pid = int(show("MainPID"))
    run("kill", "-KILL", str(pid))
    eventually(lambda: int(show("MainPID")) not in (0, pid) and metric("thermocomp_up") == 1.0,
               "it answers again")
    assert service.status()["mode"] == "compensating"


def test_a_wrong_configuration_fails_once_with_its_reason():
    SETTINGS.write_text(GATEWAY + "colour = 1\n")
    assert run("systemctl", "restart", UNIT, check=False).returncode != 0
    eventually(lambda: show("ActiveState") == "failed", "failed for good")
    assert show("ExecMainStatus") == "2"
    output = run("journalctl", "-u", UNIT, "--no-pager", "-o", "cat").stdout
    assert "http.colour = 1" in output
    SETTINGS.write_text(GATEWAY)
    run("systemctl", "reset-failed", UNIT)
    run("systemctl", "start", UNIT)
    eventually(lambda: metric("thermocomp_up") == 1.0, "it answers")


def test_a_purge_of_the_daemon_leaves_the_gateway_its_files_and_a_purge_of_both_nothing():
    PASSWORDS.write_text("maria:x\n")
    run("dpkg", "-P", "thermocomp")
    assert show("ActiveState") == "active"
    assert SETTINGS.exists() and PASSWORDS.exists()
    assert sorted(path.name for path in CONFIG.parent.iterdir()) == ["gateway.passwords", "gateway.toml"]
    eventually(lambda: metric("thermocomp_up") == 0.0, "it goes on without the daemon")
    run("dpkg", "-P", "thermocomp-gateway")
    assert not CONFIG.parent.exists()
    for file in ("/etc/passwd", "/etc/group", "/etc/shadow"):
        assert "thermocomp" not in pathlib.Path(file).read_text()
