"""Transfer of a model from the office to a machine, with a real store and daemon, and attacks."""

import json
import pathlib
import re
import subprocess
import sys

import pytest

from fleet_lab import BIN

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "daemon"))

from lab import Lab, assert_replays_exactly, eventually, run_tool  # noqa: E402
from plain_devices import MODEL, Machine, assert_slewed  # noqa: E402

BETTER = MODEL.replace("[[3.0, -1.5]]", "[[2.0, -1.5]]")  # the machine's true matrix
WORSE = MODEL.replace("[[3.0, -1.5]]", "[[4.0, -1.5]]")
OTHER_TYPE = MODEL.replace('"spindle_degC"', '"ram_degC"')
OTHER_OUTPUTS = MODEL.replace('"z_um"]', '"z_um", "y_um"]').replace("[[3.0, -1.5]]", "[[2.0, -1.5], [0.0, 0.0]]")


@pytest.fixture
def lab(tmp_path):
    opened = Lab(tmp_path)
    try:
        yield opened
    finally:
        opened.end()


def make_key(folder, name):
    """(private, public)"""
    private, public = folder / f"{name}.key", folder / f"{name}.pem"
    subprocess.run(["openssl", "genpkey", "-algorithm", "ed25519", "-out", private], check=True)
    subprocess.run(["openssl", "pkey", "-in", private, "-pubout", "-out", public], check=True)
    return private, public


class Mill:
    """A machine with earlier probings, its uplink and its admission."""

    def __init__(self, lab, store, *options, approvers=True):
        self.lab, self.store = lab, store
        store.add("mill_1", *options)
        self.machine = Machine(lab)
        self.daemon = self.machine.start()
        self.folder = lab.folder / "admit"
        self.folder.mkdir()
        keys = lab.folder / "approvers"
        keys.mkdir()
        self.key, public = make_key(lab.folder, "maria")
        public.rename(keys / "maria.pem")
        self.settings = lab.folder / "releases.toml"
        self.settings.write_text(f"""format = 1
machine = "mill_1"
config = "{self.daemon.config}"
offer = "offer.json"
folder = "admit"
""" + ('approvers = "approvers"\n' if approvers else ""))
        (lab.folder / "uplink.toml").write_text(f"""format = 1
machine = "mill_1"
store = "{store.remote('machine_mill_1').replace('user=machine_mill_1 ', '')}"
password_file = "{store.folder / 'mill_1.password'}"
history = ["{self.daemon.history}"]
offer = "offer.json"
steps = "admit/steps.json"
cpu_percent_max = 100
""")

    def probe(self):
        """Each offset is a third too large."""
        for offset_um in (3.0, 6.0, 9.0, 12.0):
            self.machine.warm_by(offset_um)
            self.daemon.wait_for_offset(offset_um, 0.05)
            assert self.daemon.cli("measured", "z", offset_um / 3.0)[0] == 0
        self.daemon.committed()
        return self

    def uplink(self):
        done = subprocess.run([str(BIN / "thermocomp-uplink"), "--once", str(self.lab.folder / "uplink.toml")],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr

    def admit(self):
        """Receives offers, runs `admit` and sends its reports: (exit status, output)."""
        self.uplink()
        status, output, problem = run_tool("admit", self.settings)
        self.uplink()
        return status, output + problem

    def offer(self, text, name="offered.toml"):
        file = self.store.folder / name
        file.write_text(text)
        return self.store.fleet("offer", "mill_1", file).split(":")[0].split()[1]

    def model(self):
        return self.machine.model.read_text()

    def steps(self, release):
        return [tuple(row) for row in self.store.ask(
            f"SELECT step, who, detail FROM fleet.release_step WHERE release = {release} ORDER BY id")]

    def ends_with(self, release, step, reason):
        self.admit()
        last, who, detail = self.steps(release)[-1]
        assert last == step and who == "machine_mill_1" and reason in detail, self.steps(release)
        assert self.model() == MODEL and "candidate" not in self.daemon.status()

    def force(self, sql):
        """As an intruder on the server."""
        self.store.ask(sql)


def test_an_approved_release_is_promoted_and_taken_back(lab, store):
    mill = Mill(lab, store, "--central").probe()
    release = mill.offer(BETTER)
    status, output = mill.admit()
    assert status == 0 and "over 4 probings" in output, output
    left, of = map(float, re.search(r"leaves ([\d.]+) of ([\d.]+) um", output).groups())
    assert left < 0.3 and 1.0 < of < 1.6, output
    assert mill.daemon.status()["candidate"]["file"] == str(mill.folder / "candidate.toml")
    assert mill.model() == MODEL
    mill.admit()  # without an approval nothing happens
    assert [step for step, _, _ in mill.steps(release)] == ["offered", "checked", "candidate"]
    assert mill.steps(release)[-1][2].endswith("not probed yet")

    # The approver sees its performance: of 15 um the model removes a third too much; the candidate
    # leaves no error.
    mill.machine.warm_by(15.0)
    mill.daemon.wait_for_offset(15.0, 0.05)
    assert mill.daemon.cli("measured", "z", 5.0)[0] == 0
    mill.admit()
    step, _, score = mill.steps(release)[-1]
    print(score)
    assert step == "candidate" and re.search(r"z leaves [\d.]+ of [\d.]+ um over 1 probing, better with \d+ %$", score), score
    # A machine without rows is not well; the means of the last 10 s are held back.
    eventually(lambda: mill.uplink() or int(store.value("SELECT count(*) FROM fleet.sample")) > 0, "a first row")
    assert f"release {release}, mill_1: candidate, {score}" in store.fleet("status")
    mill.machine.warm_by(12.0)
    mill.daemon.wait_for_offset(12.0, 0.05)

    store.fleet("approve", release, "--key", mill.key)
    assert mill.admit()[0] == 0
    assert mill.model() == BETTER
    mill.daemon.wait_for_offset(8.0, 0.05)
    assert "is worse" not in mill.admit()[1]  # no repetition
    store.fleet("rollback", release, "--key", mill.key)  # one command
    mill.admit()
    assert mill.model() == MODEL
    mill.daemon.wait_for_offset(12.0, 0.05)
    assert [(step, who) for step, who, _ in mill.steps(release)] == [
        ("offered", "postgres"), ("checked", "machine_mill_1"), ("candidate", "machine_mill_1"),
        ("candidate", "machine_mill_1"), ("approved", "postgres"), ("promoted", "machine_mill_1"), ("rollback", "postgres"),
        ("rolled_back", "machine_mill_1")]
    assert "as ordered by maria" in mill.steps(release)[5][2]
    assert "rolled_back" in store.fleet("approve", release, "--key", mill.key, status=1)
    assert_slewed(mill.machine.controller.orders())
    mill.daemon.end()
    assert_replays_exactly(mill.daemon.history, lab.folder / "out.csv")


def test_unsuitable_models_are_refused_with_the_reason(lab, store):
    mill = Mill(lab, store, "--central").probe()
    mill.ends_with(mill.offer(WORSE), "refused", "is worse here than the model in use: z_um: leaves")
    mill.ends_with(mill.offer(OTHER_TYPE), "refused", "ram_degC")
    mill.ends_with(mill.offer(OTHER_OUTPUTS), "refused", "has the outputs")
    mill.ends_with(mill.offer(MODEL), "refused", "is the model in use")
    half = BETTER[:len(BETTER) // 2]
    (store.folder / "half.toml").write_text(half)
    assert "half.toml" in store.fleet("offer", "mill_1", store.folder / "half.toml", status=2)
    # From a compromised server.
    mill.force("ALTER TABLE fleet.document DROP CONSTRAINT document_check")
    release = mill.offer(BETTER)
    mill.force(f"UPDATE fleet.document SET content = left(content, {len(half)}) WHERE content LIKE '%2.0, -1.5%'")
    mill.ends_with(release, "refused", f"the model is not whole: its {len(half)} bytes")
    mill.force("DELETE FROM fleet.document WHERE length(content) = " + str(len(half)) +
               " AND NOT EXISTS (SELECT FROM fleet.release WHERE model = checksum)")
    offer = lab.folder / "offer.json"
    whole = offer.read_text()
    offer.write_text(whole[:len(whole) // 2])
    status, _, problem = run_tool("admit", mill.settings)
    assert status == 2 and "is not a whole offer" in problem
    theirs = dict(json.loads(whole), release=int(release) + 1, machine="mill_2")
    offer.write_text(json.dumps(theirs))
    status, output, _ = run_tool("admit", mill.settings)
    assert status == 1 and "is for machine mill_2, this is mill_1" in output
    offer.write_text(json.dumps(dict(theirs, release=1)))
    status, _, problem = run_tool("admit", mill.settings)
    assert status == 2 and "is older than" in problem
    assert mill.model() == MODEL and "candidate" not in mill.daemon.status()


def test_a_forged_approval_is_refused(lab, store):
    mill = Mill(lab, store, "--central").probe()
    stranger, _ = make_key(lab.folder, "stranger")

    def approval(release):
        return store.value(f"SELECT detail FROM fleet.release_step WHERE release = {release} AND step = 'approved'")

    def forge(release, detail):
        mill.force(f"INSERT INTO fleet.release_step (release, step, who, detail) "
                   f"VALUES ({release}, 'approved', 'person_maria', '{detail}')")

    forged = mill.offer(BETTER)
    mill.admit()
    forge(forged, "yes")
    mill.ends_with(forged, "refused", "the approval is not signed by a key")
    other_key = mill.offer(BETTER)
    mill.admit()
    store.fleet("approve", other_key, "--key", stranger)
    mill.ends_with(other_key, "refused", "the approval is not signed by a key")
    right = mill.offer(BETTER)
    store.fleet("approve", right, "--key", mill.key)  # before the machine has seen it
    mill.uplink()
    seen_before = mill.offer(BETTER)
    mill.admit()
    forge(seen_before, approval(right))  # maria's, for another release
    mill.ends_with(seen_before, "refused", "the approval is not signed by a key")
    worse = mill.offer(WORSE)
    store.fleet("approve", worse, "--key", mill.key)  # even with hers
    mill.ends_with(worse, "refused", "is worse here")
    mill.daemon.wait_for_offset(12.0, 0.05)


def test_where_operators_approve_the_server_promotes_nothing(lab, store):
    mill = Mill(lab, store, approvers=False).probe()
    release = mill.offer(BETTER)
    mill.admit()
    assert "is approved at the machine" in store.fleet("approve", release, "--key", mill.key, status=1)
    mill.force("UPDATE fleet.machine SET approval = 'central'")
    store.fleet("approve", release, "--key", mill.key)
    mill.admit()
    assert mill.model() == MODEL
    assert mill.daemon.cli("promote")[0] == 0
    mill.admit()
    assert "by an operator at the machine" in mill.steps(release)[-1][2] and mill.model() == BETTER
    assert mill.daemon.cli("promote", "--back")[0] == 0
    mill.admit()
    assert mill.steps(release)[-1][0] == "rolled_back" and mill.model() == MODEL
    withdrawn = mill.offer(BETTER)
    mill.admit()
    store.fleet("rollback", withdrawn)
    mill.ends_with(withdrawn, "refused", "withdrawn")


def test_without_probings_two_models_without_claimed_error_are_not_compared(lab, store):
    mill = Mill(lab, store)
    mill.machine.warm_by(9.0)
    mill.daemon.wait_for_offset(9.0, 0.05)
    mill.daemon.committed()
    mill.ends_with(mill.offer(BETTER), "refused", "neither states an error")
