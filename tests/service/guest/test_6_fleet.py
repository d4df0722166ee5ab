"""The installed units for many machines: uplink, admission with its own user, page of a store."""

import json
import pathlib
import pwd
import re

import pytest

import service
from lab import eventually
from service import CONFIG, run
from test_5_gateway import ask as ask_page

UPLINK, PAGE, ADMIT, TIMER = (f"thermocomp-{name}" for name in (
    "uplink.service", "fleet-page.service", "admit.service", "admit.timer"))
ADMITTED = pathlib.Path("/var/lib/thermocomp-admit/model.toml")
AUTHORITY = "/etc/ssl/certs/ssl-cert-snakeoil.pem"  # of Debian's PostgreSQL; no server name
BETTER = service.MODEL.replace("[[3.0, -1.5]]", "[[2.0, -1.5]]")
EXPOSURE_MAX = 1.5


def show(unit, name):
    return run("systemctl", "show", unit, "-p", name, "--value").stdout.strip()


def as_user(user, *command, group=None, check=True):
    return run("setpriv", "--reuid", user, "--regid", group or user, "--init-groups", *command, check=check)


def sql(text):
    return as_user("postgres", "psql", "-XqAt", "-c", text, "thermocomp_fleet").stdout.split("\n")[:-1]


def fleet(*arguments):
    return as_user("postgres", "thermocomp-fleet", *arguments).stdout


def steps():
    return sql("SELECT step FROM fleet.release_step ORDER BY id")


@pytest.fixture(scope="module")
def office():
    """PostgreSQL as installed by Debian, with a store, and an approver's key."""
    run("systemctl", "unmask", "postgresql.service")
    run("systemctl", "start", "postgresql@15-main.service")
    as_user("postgres", "createdb", "thermocomp_fleet")
    fleet("init")
    fleet("add", "mill_3", "--type", "mill", "--central", "-o", "/tmp/uplink.password")
    keys = CONFIG.parent / "releases_approvers"
    keys.mkdir()
    run("openssl", "genpkey", "-algorithm", "ed25519", "-out", "/tmp/maria.key")
    run("openssl", "pkey", "-in", "/tmp/maria.key", "-pubout", "-out", keys / "maria.pem")
    run("chown", "postgres", "/tmp/maria.key")


def test_installed_they_start_nothing_before_they_are_configured():
    for name in ("thermocomp", "thermocomp-uplink", "thermocomp-fleet"):
        run("dpkg", "-i", service.package(name))
    for unit in (UPLINK, PAGE, ADMIT):
        run("systemctl", "start", unit)
        assert (show(unit, "ActiveState"), show(unit, "ConditionResult")) == ("inactive", "no"), unit
    assert run("systemctl", "is-enabled", TIMER, check=False).stdout.strip() == "disabled"
    for package in ("uplink", "fleet"):
        for example in pathlib.Path(f"/usr/share/doc/thermocomp-{package}/examples").iterdir():
            assert example.name in ("uplink.toml", "releases.toml", "fleet_page.toml")


def test_the_uplink_sends_what_the_daemon_records(machine, office):
    # The model is in admit's folder, which its first start, without an offer, makes.
    (CONFIG.parent / "releases.toml").write_text('format = 1\nmachine = "mill_3"\napprovers = "releases_approvers"\n')
    run("systemctl", "start", ADMIT)
    ADMITTED.write_text(service.MODEL)
    service.write_config(machine.config().replace('"model.toml"', f'"{ADMITTED}"'))
    machine.warm_by(0.0)
    service.start()
    for offset_um in (3.0, 6.0, 9.0, 12.0):  # each a third too large
        machine.settled_at(offset_um)
        run("thermocomp", "measured", "z", offset_um / 3.0)
    run("install", "-m", "640", "-g", "thermocomp-uplink", "/tmp/uplink.password", CONFIG.parent)
    (CONFIG.parent / "uplink.toml").write_text(
        'format = 1\nmachine = "mill_3"\npassword_file = "uplink.password"\nperiod_s = 1\ncpu_percent_max = 5\n'
        f'store = "host=localhost dbname=thermocomp_fleet sslmode=verify-ca sslrootcert={AUTHORITY}"\n')
    run("systemctl", "start", UPLINK)
    eventually(lambda: sql("SELECT 1 FROM fleet.sample LIMIT 1") == ["1"], "rows arrive", 90)
    eventually(lambda: sql("SELECT 1 FROM fleet.probing OFFSET 3") == ["1"], "and probings", 90)
    uplink = pathlib.Path("/proc") / show(UPLINK, "MainPID")
    assert uplink.stat().st_uid == pwd.getpwnam("thermocomp-uplink").pw_uid


def test_admit_takes_an_offer_to_candidate_and_what_is_approved_into_use(machine, office):
    pathlib.Path("/tmp/better.toml").write_text(BETTER)
    fleet("offer", "mill_3", "/tmp/better.toml")
    drop_in = pathlib.Path(f"/etc/systemd/system/{TIMER}.d")
    drop_in.mkdir()
    (drop_in / "often.conf").write_text("[Timer]\nOnActiveSec=\nOnActiveSec=1s\nOnUnitInactiveSec=1s\nAccuracySec=100ms\n")
    run("systemctl", "daemon-reload")
    run("systemctl", "start", TIMER)
    eventually(lambda: "candidate" in steps(), "the offer runs beside the model", 90)
    assert service.status()["candidate"]["problem"] == ""
    assert ADMITTED.read_text() == service.MODEL
    orders = machine.count()
    fleet("approve", "1", "--key", "/tmp/maria.key")
    eventually(lambda: "promoted" in steps(), "the approved model is promoted", 90)
    assert ADMITTED.read_text() == BETTER
    service.wait_for_offset(8.0)
    service.assert_slewed(machine.orders_since(orders))
    print("\n".join(sql("SELECT step, who, detail FROM fleet.release_step WHERE step <> 'approved' ORDER BY id")))
    run("systemctl", "stop", TIMER)
    run("rm", "-r", drop_in)
    run("systemctl", "daemon-reload")


def test_admit_may_change_the_model_and_nothing_else(office):
    def may(*command):
        return as_user("thermocomp-admit", "thermocomp", *command, group="thermocomp-model", check=False).returncode == 0

    assert may("reload") and may("status")
    assert may("candidate", "none")
    for command in (("disable",), ("reference", "--force"), ("measured", "z", "1"), ("cycle-end",), ("prove", "z", "2")):
        assert not may(*command), command
    assert service.status()["enabled"]
    # Its user has no network in its unit, and the uplink no rights at the daemon.
    assert show(ADMIT, "PrivateNetwork") == "yes" and show(ADMIT, "User") == "thermocomp-admit"
    refused = as_user("thermocomp-uplink", "thermocomp", "candidate", "none", check=False)
    assert refused.returncode == 2 and "only for root" in refused.stdout + refused.stderr, refused


def test_the_page_answers_as_a_role_that_reads(office):
    sql('CREATE ROLE "thermocomp-fleet-page" LOGIN')
    sql('GRANT fleet_page TO "thermocomp-fleet-page"')
    (CONFIG.parent / "fleet_page.toml").write_text("format = 1\n")
    run("systemctl", "start", PAGE)
    assert show(PAGE, "ActiveState") == "active"
    status, page = ask_page("/")
    assert status == 200 and "<title>" in page
    [shown] = json.loads(ask_page("/api/machines")[1])
    assert shown["name"] == "mill_3" and shown["release_step"] == "promoted"
    pid = show(PAGE, "MainPID")
    assert pathlib.Path(f"/proc/{pid}").stat().st_uid == pwd.getpwnam("thermocomp-fleet-page").pw_uid


@pytest.mark.parametrize("unit", [UPLINK, ADMIT, PAGE])
def test_their_exposure_is_at_most_1_5(unit):
    text = run("systemd-analyze", "security", unit, "--no-pager").stdout
    print(text.splitlines()[-1])
    assert float(re.search(rf"exposure level for {unit}: ([0-9.]+)", text).group(1)) <= EXPOSURE_MAX, text


def test_a_purge_of_the_uplink_leaves_the_daemon_its_model_and_a_purge_of_all_nothing():
    run("dpkg", "-P", "thermocomp-uplink", "thermocomp-fleet")
    assert not pathlib.Path("/proc", show(UPLINK, "MainPID"), "exe").exists()
    run("systemctl", "restart", service.UNIT)
    service.wait_for_mode("compensating")
    assert [path.name for path in sorted(ADMITTED.parent.iterdir())] == ["model.toml", "model.toml.before"]
    run("dpkg", "-P", "thermocomp")
    assert not CONFIG.parent.exists() and not ADMITTED.parent.exists()
    for file in ("/etc/passwd", "/etc/group", "/etc/shadow"):
        assert "thermocomp" not in pathlib.Path(file).read_text()
