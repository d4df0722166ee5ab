"""scripts/setup.sh with fake package tools."""
import os
import subprocess

import pytest
from conftest import SOURCE

DPKG_QUERY = """#!/bin/sh
shift 3
for name; do if [ -e "$FAKE/installed/$name" ]; then echo "installed $name"; else failed=1; fi; done
exit ${failed:-0}
"""
APT_GET = """#!/bin/sh
echo "$@" >> "$FAKE/calls"
case "$*" in
  *update*) [ -e "$FAKE/offline" ] && exit 100; touch "$FAKE/lists"; exit 0 ;;
esac
[ -e "$FAKE/lists" ] || exit 100
case "$*" in *--simulate*) exit 0 ;; esac
for word; do : > "$FAKE/installed/$word"; done
"""


@pytest.fixture
def system(tmp_path):
    for name, text in (("dpkg-query", DPKG_QUERY), ("apt-get", APT_GET),
                       ("id", "#!/bin/sh\necho 0\n")):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    (tmp_path / "installed").mkdir()
    (tmp_path / "installed" / "cmake").touch()
    (tmp_path / "calls").write_text("")
    return tmp_path


def set_up(system, what="demo"):
    return subprocess.run(
        [SOURCE / "scripts" / "setup.sh", what], capture_output=True, text=True, timeout=60,
        env={**os.environ, "FAKE": str(system), "PATH": f"{system}:/usr/bin:/bin"})


def test_a_fresh_system_gets_its_lists_and_then_the_packages(system):
    answer = set_up(system)
    assert answer.returncode == 0, answer.stderr
    assert "installing" in answer.stdout and "libmodbus-dev" in answer.stdout
    assert " cmake" not in answer.stdout
    assert "update" in (system / "calls").read_text()


def test_lists_at_hand_are_not_fetched_again(system):
    (system / "lists").touch()
    assert set_up(system).returncode == 0
    assert "update" not in (system / "calls").read_text()


def test_with_everything_installed_nothing_is_called(system):
    (system / "lists").touch()
    assert set_up(system, "test").returncode == 0
    (system / "calls").write_text("")
    assert set_up(system, "test").returncode == 0
    assert (system / "calls").read_text() == ""


def test_without_a_network_one_line_has_the_advice(system):
    (system / "offline").touch()
    answer = set_up(system)
    assert answer.returncode == 1
    assert answer.stderr.splitlines()[-1].startswith("setup: apt-get could not install")


def test_a_usage_error_is_status_2(system):
    answer = set_up(system, "nosuch")
    assert answer.returncode == 2
    assert answer.stderr == "usage: setup.sh build|modelling|petsc|demo|demo_fleet|test|checks|bench\n"
