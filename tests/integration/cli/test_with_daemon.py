"""Commands over the status socket, against answers chosen by the test."""
import json

import pytest
from conftest import run, status_answer


def test_without_a_daemon_the_answer_is_one_line_and_status_2(tmp_path):
    for command in (["status"], ["sensors"], ["watch"], ["enable"], ["prove", "z", "5"]):
        answer = run("--socket", tmp_path / "none.sock", *command)
        assert answer.returncode == 2, command
        assert answer.stderr.count("\n") == 1 and "none.sock" in answer.stderr


def test_status_is_0_when_compensating(daemon):
    answer = run("--socket", daemon.path, "status")
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.startswith("Compensating    : yes, for 1 min 5 s\n")
    assert "\033" not in answer.stdout


@pytest.mark.parametrize("changes", [
    {"mode": "holding", "reasons": ["block_lost"]},
    {"mode": "disabled", "reasons": ["operator_disabled"]},
    {"mode": "starting", "reasons": ["no_reference"]},
    {"axes": [{"name": "z", "driven": False}]}])
def test_status_is_1_when_not_compensating(daemon, changes):
    daemon.answers["status"] = status_answer(**changes)
    answer = run("--socket", daemon.path, "status")
    assert answer.returncode == 1
    assert answer.stdout.startswith("Compensating    : no")
    assert run("--socket", daemon.path, "status", "--json").returncode == 1


def test_json_is_the_daemons_answer_and_why_the_exit_status(daemon):
    answer = run("--socket", daemon.path, "status", "--json")
    assert json.loads(answer.stdout) == daemon.answers["status"] | {"exit_status": 0, "why": []}


def test_the_socket_can_be_named_by_the_environment(daemon):
    assert run("status", env={"THERMOCOMP_SOCKET": daemon.path}).returncode == 0


def test_operator_commands_ask_the_right_method(daemon):
    for arguments, method, params in (
            (["enable"], "enable", {}), (["disable"], "disable", {}),
            (["reference"], "reference", {}), (["cycle-end"], "cycle_end", {}),
            (["reload"], "reload", {}),
            (["measured", "z", "-1.5"], "measured", {"axis": "z", "value_um": -1.5}),
            (["prove", "z", "5"], "prove", {"axis": "z", "value_um": 5.0})):
        answer = run("--socket", daemon.path, *arguments)
        assert answer.returncode == 0, answer.stderr
        assert daemon.requests[-1]["method"] == method
        assert daemon.requests[-1].get("params", {}) == params


def test_a_refusal_is_1_and_a_forbidden_or_wrong_request_is_2(daemon):
    for code, status in ((-32002, 1), (-32001, 2), (-32602, 2)):
        daemon.answers["prove"] = (code, "because of a reason")
        answer = run("--socket", daemon.path, "prove", "z", "5")
        assert answer.returncode == status
        assert "because of a reason" in answer.stderr


def test_watch_prints_plain_lines_when_it_is_no_terminal(daemon):
    answer = run("--socket", daemon.path, "watch", "--for", "0.5", "--period", "0.1")
    assert answer.returncode == 0, answer.stderr
    assert "\033" not in answer.stdout


def test_watch_shows_what_comes(daemon):
    # The connection stays silent after three notifications: the watch ends as unreachable.
    answer = run("--socket", daemon.path, "watch", "--period", "0.1")
    assert answer.returncode == 2
    assert answer.stdout.count("compensating") == 3
