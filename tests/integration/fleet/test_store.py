"""Permissions in the store."""

import shutil
import subprocess

import pytest

from fleet_lab import BIN

MODEL = "format = 1"


def document(text, kind="model"):
    return f"INSERT INTO fleet.document VALUES (encode(sha256('{text}'), 'hex'), '{kind}', '{text}')"


@pytest.fixture
def two_machines(store):
    store.add("mill_1")
    store.add("mill_2", "--central")
    for machine in ("mill_1", "mill_2"):
        status, _, problem = store.as_machine(machine, document(MODEL) + " ON CONFLICT DO NOTHING;" + f"""
            INSERT INTO fleet.setup SELECT fleet.my_machine(), 1, encode(sha256('{MODEL}'), 'hex'),
              encode(sha256('{MODEL}'), 'hex'), '{{head_degC}}', '1';
            INSERT INTO fleet.sample SELECT fleet.my_machine(), 1, date_trunc('minute', now()), '{{20}}';
            INSERT INTO fleet.event SELECT fleet.my_machine(), now(), 1, 1, 'mode', 'compensating', '{{}}';
            INSERT INTO fleet.uplink (machine, history) SELECT fleet.my_machine(), 'history.db'""")
        assert status == 0, problem
    store.ask(f"""
        WITH made AS (INSERT INTO fleet.release (machine, model)
          SELECT id, encode(sha256('{MODEL}'), 'hex') FROM fleet.machine RETURNING id)
        INSERT INTO fleet.release_step (release, step) SELECT id, 'offered' FROM made""")
    return store


def number(store, machine):
    return store.value(f"SELECT id FROM fleet.machine WHERE name = '{machine}'")


def test_a_machine_reads_its_own_releases_and_their_model(two_machines):
    status, rows, _ = two_machines.as_machine(
        "mill_1", "SELECT content, step FROM fleet.release_state JOIN fleet.document ON checksum = model")
    assert (status, rows) == (0, [[MODEL, "offered"]])


REFUSED = {
    # name: (statement, message); OTHER and OWN stand for machines, THEIRS and MINE for releases
    "rows of another": ("INSERT INTO fleet.sample VALUES (OTHER, 1, now(), '{1}')", "row-level security"),
    "events of another": ("INSERT INTO fleet.event VALUES (OTHER, now(), 1, 2, 'mode', '', '{}')", "row-level security"),
    "probings of another": ("INSERT INTO fleet.probing VALUES (OTHER, now(), 'z_um', 0, 1, 1)", "row-level security"),
    "a setup of another": ("INSERT INTO fleet.setup SELECT OTHER, 2, checksum, checksum, '{a}', '2' "
                           "FROM fleet.document", "row-level security"),
    "progress of another": ("INSERT INTO fleet.uplink (machine, history) VALUES (OTHER, 'x')", "row-level security"),
    "its rows given away": ("UPDATE fleet.uplink SET machine = OTHER", "row-level security"),
    "rows read": ("SELECT * FROM fleet.sample", "permission denied"),
    "rows read past their table": ("SELECT * FROM fleet.PARTITION", "permission denied"),
    "rows added past their table": ("INSERT INTO fleet.PARTITION VALUES (OTHER, 1, now(), '{1}')", "permission denied"),
    "rows changed": ("UPDATE fleet.sample SET value = '{0}'", "permission denied"),
    "rows deleted": ("DELETE FROM fleet.sample", "permission denied"),
    "its past deleted": ("DELETE FROM fleet.event", "permission denied"),
    "results read": ("SELECT * FROM fleet.night_result", "permission denied"),
    "results written": ("INSERT INTO fleet.night_result (machine, night, model, program_version, state) "
                        "VALUES (OWN, '2026-01-01', '', '', 'done')", "permission denied"),
    "a release of its own": ("INSERT INTO fleet.release (machine, model) SELECT OWN, checksum FROM fleet.document",
                             "permission denied"),
    "a release changed": ("UPDATE fleet.release SET note = 'x'", "permission denied"),
    "a step of another": ("INSERT INTO fleet.release_step (release, step) VALUES (THEIRS, 'promoted')",
                          "row-level security"),
    "a central approval": ("INSERT INTO fleet.release_step (release, step) VALUES (MINE, 'approved')",
                           "row-level security"),
    "an approval in another's name": ("INSERT INTO fleet.release_step (release, step, who) "
                                      "VALUES (MINE, 'approved_at_machine', 'maria')", "row-level security"),
    "a step deleted": ("DELETE FROM fleet.release_step", "permission denied"),
    "a step changed": ("UPDATE fleet.release_step SET step = 'approved'", "permission denied"),
    "a machine added": ("INSERT INTO fleet.machine (name, type) VALUES ('mill_9', 'mill')", "permission denied"),
    "another type": ("UPDATE fleet.machine SET type = 'x'", "permission denied"),
    "a table": ("CREATE TABLE fleet.mine (a int)", "permission denied"),
    "a temporary table": ("CREATE TEMPORARY TABLE mine (a int)", "permission denied"),
    "everything deleted": ("TRUNCATE fleet.sample", "permission denied"),
    "another's role": ("SET ROLE machine_mill_2", "permission denied"),
    "a role": ("CREATE ROLE helper", "permission denied"),
    "a program run": ("COPY fleet.setup TO PROGRAM 'cat'", "must be superuser"),
    "a file read": ("SELECT pg_read_file('postgresql.conf')", "permission denied"),
    "a model under a wrong checksum": ("INSERT INTO fleet.document VALUES (repeat('0', 64), 'model', 'x')",
                                       "check constraint"),
    "a row of next week": ("INSERT INTO fleet.sample VALUES (OWN, 1, now() + interval '7 days', '{1}')",
                           "row-level security"),
    "a row of two years ago": ("INSERT INTO fleet.event VALUES (OWN, now() - interval '2 years', 1, 3, 'mode', '', '{}')",
                               "row-level security"),
}


def test_a_machine_cannot_access_rows_of_others(two_machines):
    own, other = number(two_machines, "mill_1"), number(two_machines, "mill_2")
    release = {machine: two_machines.value(f"SELECT id FROM fleet.release WHERE machine = {machine}")
               for machine in (own, other)}
    partition = two_machines.value("SELECT 'sample_' || to_char(now() AT TIME ZONE 'UTC', 'YYYY_MM')")
    before = two_machines.ask("SELECT * FROM fleet.sample ORDER BY 1; SELECT * FROM fleet.release_step ORDER BY 1;"
                              "SELECT machine, history FROM fleet.uplink ORDER BY 1")
    assert len(REFUSED) >= 20
    for name, (statement, rule) in REFUSED.items():
        for word, value in {"OTHER": other, "OWN": own, "THEIRS": release[other], "MINE": release[own],
                            "PARTITION": partition}.items():
            statement = statement.replace(word, value)
        status, _, problem = two_machines.as_machine("mill_1", statement)
        assert status != 0 and rule in problem, (name, statement, problem)
    assert before == two_machines.ask("SELECT * FROM fleet.sample ORDER BY 1; SELECT * FROM fleet.release_step "
                                      "ORDER BY 1; SELECT machine, history FROM fleet.uplink ORDER BY 1")


def test_another_machine_is_not_seen(two_machines):
    for table in ("machine", "setup", "uplink", "release", "release_step"):
        status, rows, problem = two_machines.as_machine("mill_1", f"SELECT count(*) FROM fleet.{table}")
        assert (status, rows) == (0, [["1"]]), (table, problem)


def test_who_approves_is_decided_by_the_machine(two_machines):
    store = two_machines
    store.add_person("maria", "fleet_approval")
    store.add_person("otto", "fleet_release")
    release = {machine: store.value(f"SELECT id FROM fleet.release WHERE machine = {number(store, machine)}")
               for machine in ("mill_1", "mill_2")}

    def step(who, machine, name):
        run = store.as_machine if who in release else store.as_person
        return run(who, f"INSERT INTO fleet.release_step (release, step) VALUES ({release[machine]}, '{name}')")[0] == 0

    assert step("maria", "mill_2", "approved")
    assert not step("maria", "mill_1", "approved")  # approved at the machine
    assert not step("otto", "mill_2", "approved")   # the offering person does not approve
    assert not step("mill_2", "mill_2", "approved_at_machine")
    assert step("mill_1", "mill_1", "approved_at_machine")
    assert store.ask("SELECT who FROM fleet.release_step WHERE step LIKE 'approved%' ORDER BY who") == [
        ["machine_mill_1"], ["person_maria"]]


def test_without_tls_no_login_succeeds(two_machines):
    store = two_machines
    def connect(tls):
        return store.server.run_sql("SELECT 1", conninfo=store.remote("machine_mill_1", tls=tls),
                                    password=store.password("mill_1"))
    assert connect("sslmode=verify-full")[0] == 0
    assert "no encryption" in connect("sslmode=disable")[2]
    # Another server, or another name.
    assert "certificate" in connect("sslmode=verify-full hostaddr=127.0.0.1 host=other.example")[2]


def test_a_migration_that_was_changed_is_refused(store, tmp_path):
    """The program finds the schema beside its folder."""
    installed = tmp_path / "installed"
    (installed / "bin").mkdir(parents=True)
    shutil.copy2(BIN / "thermocomp-fleet", installed / "bin")
    schema = installed / "share/thermocomp/fleet/schema"
    shutil.copytree(BIN.parent / "share/thermocomp/fleet/schema", schema)

    def init():
        return subprocess.run([str(installed / "bin/thermocomp-fleet"), "--store", store.local, "init"],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True)
    (schema / "900_more.sql").write_text("CREATE TABLE fleet.more (a integer);")
    assert "applied 900_more.sql" in init().stdout
    assert "applied" not in init().stdout
    (schema / "900_more.sql").write_text("CREATE TABLE fleet.more (b integer);")
    assert "900_more.sql: was changed" in init().stderr
    (schema / "900_more.sql").unlink()
    assert "update the program" in init().stderr
    (schema / "901_bad.sql").write_text("CREATE TABLE fleet.half (a integer); SELECT nonsense;")
    (schema / "900_more.sql").write_text("CREATE TABLE fleet.more (a integer);")
    assert init().returncode == 2
    assert store.value("SELECT count(*) FROM pg_tables WHERE tablename = 'half'") == "0"


def test_a_password_is_kept_or_the_machine_is_not_added(store):
    (store.folder / "mill_3.password").write_text("kept")
    assert "already exists" in store.fleet("add", "mill_3", "--type", "mill", "-o", store.folder / "mill_3.password",
                                           status=2)
    assert store.value("SELECT count(*) FROM fleet.machine") == "0"
    store.fleet("add", "mill_3", "--type", "mill", "-o", store.folder / "no_folder" / "mill_3.password", status=2)
    assert store.value("SELECT count(*) FROM fleet.machine") == "0"  # its password would be lost
    store.add("mill_4")
    assert (store.folder / "mill_4.password").stat().st_mode & 0o777 == 0o600
