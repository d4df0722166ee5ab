"""Files removed by a purge, per package, in a folder used as root (DPKG_ROOT)."""

import os
import pathlib
import subprocess

import pytest

DEBIAN = pathlib.Path(__file__).parents[2] / "debian"
CONFIG, STATE = pathlib.Path("etc/thermocomp"), pathlib.Path("var/lib/thermocomp")
MODEL = pathlib.Path("var/lib/thermocomp-admit/model.toml")
UPLINKS = (CONFIG / "uplink.password", CONFIG / "releases.toml", CONFIG / "releases_approvers/maria.pem", MODEL,
           MODEL.with_name("steps.json"), pathlib.Path("var/lib/thermocomp-uplink/offer.json"))


@pytest.fixture
def root(tmp_path):
    for name in (CONFIG / "thermocompd.toml", CONFIG / "model.toml", CONFIG / ".hidden",
                 CONFIG / "gateway.toml", CONFIG / "gateway.passwords", CONFIG / "gateway.key",
                 CONFIG / "devices/ours.toml", STATE / "history.db",
                 *UPLINKS, CONFIG / "fleet_page.toml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("something\n")
    return tmp_path


def after(package, action, root):
    """Runs the package's script as dpkg does with another root."""
    subprocess.run(["sh", DEBIAN / f"{package}.postrm", action], check=True, timeout=60,
                   env={"PATH": os.environ["PATH"], "DPKG_ROOT": str(root)})
    return sorted(str(path.relative_to(root)) for path in root.rglob("*") if path.is_file())


def test_a_removal_keeps_everything(root):
    before = after("thermocomp", "remove", root)
    assert len(before) == 15
    for package in ("gateway", "uplink", "fleet"):
        assert after(f"thermocomp-{package}", "remove", root) == before


def installed(package, root):
    file = root / f"usr/lib/sysusers.d/{package}.conf"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("")
    return file


def test_a_purge_of_the_daemon_leaves_what_is_the_others(root):
    uplink = installed("thermocomp-uplink", root)
    assert set(after("thermocomp", "purge", root)) == {
        *map(str, UPLINKS), *(f"etc/thermocomp/gateway.{end}" for end in ("key", "passwords", "toml")),
        "etc/thermocomp/fleet_page.toml", str(uplink.relative_to(root))}
    uplink.unlink()
    after("thermocomp-uplink", "purge", root)
    after("thermocomp-fleet", "purge", root)
    assert after("thermocomp-gateway", "purge", root) == []
    assert not (root / CONFIG).exists()


def test_a_purge_of_the_others_leaves_what_the_daemon_runs_with(root):
    daemon = installed("thermocomp", root)
    for package in ("gateway", "uplink", "fleet"):
        left = after(f"thermocomp-{package}", "purge", root)
    assert len(left) == 7 and str(MODEL) in left
    assert (root / CONFIG / "thermocompd.toml").exists()
    daemon.unlink()
    assert after("thermocomp", "purge", root) == []
    assert not (root / CONFIG).exists() and not (root / STATE).exists()


def test_a_purge_of_an_unconfigured_package_is_complete(tmp_path):
    assert after("thermocomp", "purge", tmp_path) == []
    assert after("thermocomp-gateway", "purge", tmp_path) == []
