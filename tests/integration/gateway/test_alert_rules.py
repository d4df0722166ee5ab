"""The shipped alert rules, checked by promtool: no warnings, and each fires and ends when it must
(alert_rules.yml)."""

import pathlib
import re
import shutil
import subprocess

import pytest

from lab import SOURCE

RULES = SOURCE / "gateway/monitoring/thermocomp_alerts.yml"
CASES = pathlib.Path(__file__).with_name("alert_rules.yml")

pytestmark = pytest.mark.skipif(not shutil.which("promtool"), reason="prometheus is not installed")


def promtool(*arguments):
    done = subprocess.run(["promtool", *map(str, arguments)], capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def alerts():
    return re.findall(r"- alert: (\w+)", RULES.read_text())


def test_the_rules_load():
    status, output = promtool("check", "rules", RULES)
    assert status == 0 and f"{len(alerts())} rules found" in output, output
    assert "warning" not in output.lower()


def test_each_alert_fires_and_ends():
    status, output = promtool("test", "rules", CASES)
    assert status == 0, output
    cases = CASES.read_text()
    assert [name for name in alerts() if f"alertname: {name}\n" not in cases] == []


def test_every_metric_of_a_rule_is_one_that_the_gateway_answers(machine, gateway):
    gateway.wait_for(lambda s: s["here"], "a state")
    reported = set(re.findall(r"^# TYPE (\w+)", gateway.text("/metrics"), re.MULTILINE))
    # The model of the plain machine has no domain.
    reported.add("thermocomp_model_outside_domain")
    expressions = re.sub(r"#.*|summary:.*|description:.*", "", RULES.read_text())
    assert set(re.findall(r"\bthermocomp_\w+", expressions)) <= reported
