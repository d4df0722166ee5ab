"""Commands over the status socket, with answers chosen by the test."""
import contextlib
import json
import os
import pty
import re
import subprocess

import pytest
from conftest import PROGRAM, run, status_answer


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


def test_the_socket_can_be_named_behind_the_command(daemon):
    assert run("status", "--socket", daemon.path).returncode == 0
    assert run("prove", "z", "5", "--socket", daemon.path + "none").returncode == 2


def test_the_socket_can_be_named_by_the_environment(daemon):
    assert run("status", env={"THERMOCOMP_SOCKET": daemon.path}).returncode == 0


def test_operator_commands_ask_the_right_method(daemon):
    for arguments, method, params in (
            (["enable"], "enable", {}), (["disable"], "disable", {}),
            (["reference"], "reference", {}), (["cycle-end"], "cycle_end", {}),
            (["reload"], "reload", {}),
            (["reference", "--force"], "reference", {"force": True}),
            (["measured", "z", "-1.5"], "measured", {"axis": "z", "value_um": -1.5})):
        before = len(daemon.requests)
        answer = run("--socket", daemon.path, *arguments)
        assert answer.returncode == 0, answer.stderr
        asked, = [each for each in daemon.requests[before:] if each["method"] != "status"]
        assert asked["method"] == method and asked.get("params", {}) == params


def latched(applied_um, releasing):
    return status_answer(axes=[{"name": "z", "unit": "um", "driven": False, "applied": applied_um,
                                "mismatch": {"sent_um": 14.67, "read_um": 26.67,
                                             "likely": "changes by itself",
                                             "releasing": releasing}}])


def test_release_waits_for_read_backs_and_reports_unchecked_ones(daemon):
    daemon.answers["release"] = {"done": True}
    for applied_um, trusts in ((26.67, True), (14.6, False)):
        daemon.requests.clear()
        daemon.answers["status"] = [latched(applied_um, False), latched(applied_um, True),
                                    latched(applied_um, True), status_answer()]
        answer = run("--socket", daemon.path, "release", "z")
        assert answer.returncode == 0 and answer.stdout.startswith("axis z: released\n")
        assert ("read back +26.67 um where +14.67 um was sent last" in answer.stdout) == trusts
        assert [request["method"] for request in daemon.requests] == [
            "status", "release", "status", "status", "status"]
        assert daemon.requests[1]["params"] == {"axis": "z"}


def test_a_release_contradicted_by_read_backs_is_reported(daemon):
    daemon.answers["release"] = {"done": True}
    daemon.answers["status"] = [latched(26.67, False), latched(26.67, True), latched(26.67, False)]
    answer = run("--socket", daemon.path, "release", "z")
    assert answer.returncode == 1
    assert ("NOT released: it reads back +26.67 um where +14.67 um was sent last (changes by "
            "itself)") in answer.stdout


def test_measured_shows_measured_and_expected_remainder(daemon):
    daemon.answers["measured"] = {"done": True, "measured_um": 3.0, "meaning": "remaining",
                                  "predicted_um": -12.0, "predicted_remaining_um": 0.4}
    answer = run("--socket", daemon.path, "measured", "z", "3")
    assert answer.stdout.startswith(
        "axis z: measured +3.00 um left at the tool; by the model +0.40 um are left\n"), answer.stdout
    daemon.answers["measured"] |= {"meaning": "total"}
    answer = run("--socket", daemon.path, "measured", "z", "3")
    assert answer.stdout == "axis z: measured +3.00 um without offset; by the model -12.00 um\n"


def test_sensors_and_scan_report_nan_in_the_same_words(daemon):
    daemon.answers["sensors"] = {"sensors": [{"name": "bed", "raw_degC": None,
                                              "fault": "out_of_range"}], "inputs": [], "axes": []}
    assert "NaN, no number -> many modules send NaN for a broken wire" in run(
        "--socket", daemon.path, "sensors").stdout


def offsets(offset_um, applied_um, proving):
    return {"axes": [{"name": "x"}, {"name": "z", "offset": offset_um, "applied": applied_um,
                                     "proving": proving}]}


@pytest.mark.parametrize("there_um, status, words", [
    (5.0, 0, "moved and came back"), (0.1, 1, "did NOT move as commanded"),
    (-5.0, 1, "moved the OTHER way")])
def test_prove_waits_for_the_end_of_the_move_and_reports_read_backs(daemon, there_um, status,
                                                                    words):
    daemon.answers["offsets"] = [offsets(0.0, 0.0, False), offsets(2.0, 0.4 * there_um, True),
                                 offsets(5.0, there_um, True), offsets(0.0, 0.0, False)]
    daemon.answers["prove"] = {"done": True, "takes_s": 1.0}
    answer = run("--socket", daemon.path, "prove", "z", "5")
    asked = [request["method"] for request in daemon.requests]
    assert asked == ["offsets", "prove"] + 3 * ["offsets"]
    assert daemon.requests[1]["params"] == {"axis": "z", "value_um": 5.0}
    assert answer.returncode == status and words in answer.stdout, answer.stdout
    assert ("change the sign" in answer.stdout) is (status == 0), answer.stdout
    assert "\033" not in answer.stdout + answer.stderr


def test_prove_gives_up_on_a_move_that_does_not_end(daemon):
    daemon.answers["offsets"] = [offsets(0.0, 0.0, False), offsets(2.0, 1.9, True)]
    daemon.answers["prove"] = {"done": True, "takes_s": -3.5}  # leaves 3 s until the timeout
    answer = run("--socket", daemon.path, "prove", "z", "5")
    assert answer.returncode == 1 and "the move is not over" in answer.stdout
    assert "axis z: sent +2.00 um, read back +1.90 um\n" in answer.stderr


def test_a_reference_reports_how_long_temperatures_were_observed(daemon):
    for watched_s, words in ((40.0, "watched for 40 s only"), (1800.0, None)):
        daemon.answers["reference"] = {"done": True, "watched_s": watched_s, "although": ""}
        answer = run("--socket", daemon.path, "reference")
        assert answer.returncode == 0
        assert (words or "reference: the present temperatures") in answer.stdout
        assert ("watched" in answer.stdout) == bool(words)
    daemon.answers["reference"] = {"done": True, "although": "axis z has an offset of +2.00"}
    answer = run("--socket", daemon.path, "reference", "--force")
    assert "taken although axis z has an offset" in answer.stdout


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


def test_watch_shows_new_values(daemon):
    # The connection is silent after three notifications: the watch ends as unreachable.
    answer = run("--socket", daemon.path, "watch", "--period", "0.1")
    assert answer.returncode == 2 and daemon.path in answer.stderr, answer.stderr
    assert answer.stdout.count("compensating") == 3


HOSTILE = "\x1b]0;owned\x07\x1b[2J\x1b[31mEVIL\u202e\u009b\x7f"
COMMANDS = (["status"], ["status", "--json"], ["sensors"], ["sensors", "--json"], ["events"],
            ["events", "--json"], ["watch", "--for", "1"], ["enable"], ["disable"], ["reload"],
            ["reference"], ["measured", "z", "1"], ["prove", "z", "1"], ["release", "z"],
            ["cycle-end"])


def is_clean(answer):
    return not any(c in answer.stdout + answer.stderr
                   for c in ("\x1b", "\x07", "\x7f", "\u202e", "\u009b"))


def with_hostile_texts(value):
    if isinstance(value, dict):
        return {key: with_hostile_texts(each) for key, each in value.items()}
    if isinstance(value, list):
        return [with_hostile_texts(each) for each in value]
    return value + HOSTILE if isinstance(value, str) else value


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_no_text_of_the_socket_commands_the_terminal(daemon, command):
    whole = status_answer(
        reasons=["block_lost", "odd"], warnings=["w"], sensors_bad=["bed"],
        buses=[{"name": "cabinet", "kind": "modbus_tcp", "connected": False, "last_error": "e"}])
    sensors = {"sensors": [{"name": "bed", "bus": "cabinet", "blocks": ["bed"], "fault": "stale",
                            "raw_degC": 20.0, "smoothed_degC": 20.0, "age_s": 1.0}]}
    events = {"events": [{"number": 1, "wall_s": 1.0, "kind": "command", "subject": "s",
                          "text": "t", "by": "b"}]}
    daemon.answers = with_hostile_texts({"status": whole, "sensors": sensors, "events": events})
    assert is_clean(run("--socket", daemon.path, *command)), command
    for method in ("status", "sensors", "events", "enable", "disable", "reload", "reference",
                   "measured", "prove", "release", "cycle_end", "subscribe"):
        daemon.answers[method] = (-32002, "because " + HOSTILE)
    answer = run("--socket", daemon.path, *command)
    assert is_clean(answer) and "EVIL" in answer.stderr, command
    assert answer.returncode in (1, 2)


def test_no_name_of_a_file_commands_the_terminal(tmp_path):
    for command in (["check", HOSTILE], ["status", "--socket", HOSTILE], ["verify", HOSTILE],
                    ["replay", HOSTILE, "-o", HOSTILE], ["predict", "--model", HOSTILE, HOSTILE],
                    ["scan", HOSTILE], ["fit", HOSTILE, "--outputs", HOSTILE], [HOSTILE],
                    ["inspect", HOSTILE], ["simulate", HOSTILE, "-o", "x.csv"]):
        answer = run(*command, cwd=tmp_path)
        assert answer.returncode != 0 and is_clean(answer), command


def test_a_terminal_gets_colours_and_nothing_else(daemon):
    daemon.answers["status"] = with_hostile_texts(status_answer(reasons=["block_lost"]))
    master, slave = pty.openpty()
    with os.fdopen(master, "rb", buffering=0) as screen:
        subprocess.run([PROGRAM, "--socket", daemon.path, "status"], stdout=slave, stderr=slave,
                       stdin=subprocess.DEVNULL, timeout=60)
        os.close(slave)
        shown = b""
        with contextlib.suppress(OSError):
            while block := screen.read(65536):
                shown += block
    codes = set(re.findall(rb"\x1b(.{1,4}?m|.)", shown))
    assert codes and codes <= {b"[0m", b"[1m", b"[31m", b"[32m", b"[33m"}, codes
    assert b"\x1b[31mEVIL" not in shown and b"EVIL" in shown
