"""The built manual pages and completion agree with --help."""

import os
import pathlib
import pty
import re
import select
import subprocess
import time

import pytest

BIN = pathlib.Path(os.environ["THERMOCOMP_BIN"])
MANUAL = pathlib.Path(os.environ["THERMOCOMP_MANUAL"])
PAGES = ["thermocomp.1", "thermocompd.8", "thermocomp-sim.1", "thermocomp-modelling.1",
         "thermocomp-gateway.1", "thermocomp-fleet.1",
         "thermocomp-fleet-page.1", "thermocomp-uplink.1", "thermocompd.toml.5",
         "gateway.toml.5", "uplink.toml.5",
         "releases.toml.5", "fleet_page.toml.5", "thermocomp-run.5"]
PROGRAMS = {"thermocomp": "thermocomp.1", "thermocompd": "thermocompd.8",
            "thermocomp-sim": "thermocomp-sim.1",
            "thermocomp-modelling": "thermocomp-modelling.1",
            "thermocomp-gateway": "thermocomp-gateway.1",
            "thermocomp-fleet": "thermocomp-fleet.1",
            "thermocomp-fleet-page": "thermocomp-fleet-page.1", "thermocomp-uplink": "thermocomp-uplink.1"}
# Executed by another program, which has the help.
MODELLING = {"structure", "place", "tiebar", "plan", "series", "group", "fit", "diagnose", "inspect"}


def shown(page):
    """The page as displayed, without bold and italic; the formatter must not warn."""
    done = subprocess.run(["man", "--warnings", "-Tutf8", "-l", str(MANUAL / page)],
                          capture_output=True, text=True, timeout=60,
                          env={"PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8", "MANWIDTH": "100",
                               "MANROFFSEQ": "", "GROFF_NO_SGR": "1"})
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return re.sub(".\b", "", done.stdout)


def help_of(program, *command):
    return subprocess.run([BIN / program, *command, "--help"], capture_output=True, text=True,
                          timeout=60, check=True).stdout


def words(text):
    return re.findall(r"--[a-z][a-z-]*", text)


@pytest.mark.parametrize("page", PAGES)
def test_a_page_is_formatted_without_a_warning(page):
    text = shown(page)
    assert "NAME" in text and "DESCRIPTION" in text and "SEE ALSO" in text


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_option_of_the_help_is_in_the_page(program):
    text = shown(PROGRAMS[program])
    assert words(help_of(program))
    for option in words(help_of(program)):
        assert option in text
    assert "EXIT STATUS" in text


def test_every_command_of_the_help_is_in_the_page_with_its_options():
    text = shown("thermocomp.1")
    commands = set(re.findall(r"^  ([a-z][a-z-]+) ", help_of("thermocomp"), re.MULTILINE))
    assert {"check", "status", "replay", "prove"} | MODELLING <= commands
    for command in commands:
        assert re.search(rf"^   {command}\b", text, re.MULTILINE), command
        if command not in MODELLING:
            for option in words(help_of("thermocomp", command)):
                assert option in text


def test_every_modelling_command_is_in_its_page_with_its_options():
    text = shown("thermocomp-modelling.1")
    commands = re.findall(r"^  ([a-z]+) ", help_of("thermocomp-modelling"), re.MULTILINE)
    assert {"structure", "place", "diagnose"} <= set(commands) <= MODELLING
    for command in commands:
        assert re.search(rf"^   {command}\b", text, re.MULTILINE), command
        for option in words(help_of("thermocomp-modelling", command)):
            assert option in text


def test_the_configurations_page_is_the_commented_example():
    example = pathlib.Path(__file__).resolve().parents[2] / "config/examples/small_machine.toml"
    text = re.sub(r"\s+", " ", shown("thermocompd.toml.5"))
    keys = re.findall(r"^([a-z_A-Z]+) = ", example.read_text(), re.MULTILINE)
    assert len(keys) > 60
    for key in keys:
        assert f"{key} = " in text


class Shell:
    """A bash with the completion on a terminal, as for a user."""

    def __init__(self, folder):
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen(
            ["bash", "--norc", "--noprofile", "-i"], stdin=slave, stdout=slave, stderr=slave,
            cwd=folder, start_new_session=True,
            env={"PATH": os.environ["PATH"], "TERM": "dumb", "PS1": "$ ", "HOME": str(folder)})
        os.close(slave)
        self.say("bind 'set show-all-if-ambiguous on'; bind 'set page-completions off'; "
                 "bind 'set enable-bracketed-paste off'; bind 'set completion-query-items 0'\n")
        for program in PROGRAMS:
            self.say(f"source {MANUAL / program}.bash\n")
        # The prompt behind it: from then on the terminal no longer echoes typed text.
        self.until("echo rea''dy\n", "ready\r\n$ ")

    def say(self, text):
        os.write(self.master, text.encode())

    def until(self, text, mark, patience_s=20.0):
        self.say(text)
        seen, end = "", time.monotonic() + patience_s
        while mark not in seen:
            left = end - time.monotonic()
            assert left > 0, f"{mark!r} never came: {seen!r}"
            if select.select([self.master], [], [], left)[0]:
                seen += os.read(self.master, 65536).decode()
        return seen

    def completed(self, line):
        """The line after TAB, as received by echo. The program is not run."""
        # TAB, then to the beginning of the line and `: ` before it, then end it and echo it.
        seen = self.until(f"{line}\t\t\x01echo '<' \x05 '>'\n", ">\r\n")
        return seen

    def end(self):
        self.process.kill()
        self.process.wait()
        os.close(self.master)


@pytest.fixture
def shell(tmp_path):
    (tmp_path / "history one.db").touch()
    (tmp_path / "machine.toml").touch()
    opened = Shell(tmp_path)
    yield opened
    opened.end()


@pytest.mark.parametrize("typed, completed", [
    ("thermocomp sta", "thermocomp status"),
    ("thermocomp --so", "thermocomp --socket"),
    ("thermocomp --socket machine.toml sens", "thermocomp --socket machine.toml sensors"),
    ("thermocomp --socket=mach", "thermocomp --socket=machine.toml"),
    ("thermocomp check mach", "thermocomp check machine.toml"),
    ("thermocomp export hist", "thermocomp export history one.db"),
    ("thermocomp export x --fr", "thermocomp export x --from"),
    ("thermocomp replay x --output mach", "thermocomp replay x --output machine.toml"),
    ("thermocomp fit mach", "thermocomp fit machine.toml"),
    ("thermocompd --ver", "thermocompd --version"),
    ("thermocompd mach", "thermocompd machine.toml"),
    ("thermocomp-modelling plac", "thermocomp-modelling place"),
    ("thermocomp-modelling diagnose --mod", "thermocomp-modelling diagnose --model"),
    ("thermocomp-modelling diagnose --model mach",
     "thermocomp-modelling diagnose --model machine.toml"),
    ("thermocomp-sim --start", "thermocomp-sim --start-on-heartbeat"),
    ("thermocomp-sim --truth mach", "thermocomp-sim --truth machine.toml"),
])
def test_tab_completes(shell, typed, completed):
    assert f"< {completed} >" in shell.completed(typed)


@pytest.mark.parametrize("typed, offered, not_offered", [
    ("thermocomp ", ["check", "status", "prove", "diagnose"], ["machine.toml", "--socket"]),
    ("thermocomp status --", ["--json", "--help"], ["--socket", "--output"]),
    ("thermocomp-sim --p", ["--port", "--ports-file", "--path"], ["--truth"]),
])
def test_tab_offers_what_fits_and_nothing_else(shell, typed, offered, not_offered):
    seen = shell.completed(typed).split("echo '<'")[0]
    for word in offered:
        assert word in seen.split(), seen
    for word in not_offered:
        assert word not in seen.split(), seen
