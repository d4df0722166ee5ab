"""The site's command runs once per alarm, with its text, and never in a flood."""

from gateway_lab import Gateway
from lab import eventually

HOOK = """#!/bin/sh
echo "$THERMOCOMP_STATE|$THERMOCOMP_ALARM|$THERMOCOMP_MACHINE|$THERMOCOMP_TEXT|$THERMOCOMP_REMEDY" \
  >> {out}
"""


def start(lab, machine, script, more=""):
    hook = lab.folder / "hook"
    hook.write_text(script)
    hook.chmod(0o755)
    return lab.also_end(Gateway(lab, machine.daemon, "", f'[alarm]\ncommand = ["{hook}"]\n'
                                f'raise_after_s = 0.3\nclear_after_s = 0.3\n{more}')).start()


def test_each_alarm_is_raised_once_and_cleared_once(lab, machine):
    out = lab.folder / "alarms.txt"
    out.touch()
    gateway = start(lab, machine, HOOK.format(out=out))
    gateway.wait_for(lambda s: s["here"], "a state")
    machine.module.stop()

    def reported(state):
        # On a busy computer the module is told as silent before its bus is seen as lost.
        return sorted(line.split("|")[1] for line in out.read_text().splitlines()
                      if line.startswith(state) and "|unit/module|" not in line)

    expected = ["bus/cabinet", "compensation"]  # covers its sensors
    eventually(lambda: reported("raised") == expected, "all are raised")
    line = next(line for line in out.read_text().splitlines() if "|bus/cabinet|" in line)
    assert line.split("|")[2] == "mill_3" and line.split("|")[3].startswith("bus cabinet is not connected")
    machine.module.start()
    machine.module.show(20.0, 20.0)
    eventually(lambda: reported("cleared") == expected, "all are cleared")
    assert reported("raised") == expected


def test_a_hanging_command_is_ended_and_the_page_continues(lab, machine):
    out = lab.folder / "hung.txt"
    gateway = start(lab, machine, f"#!/bin/sh\necho x >> {out}\nexec sleep 30\n", "command_s_max = 1")
    machine.module.stop()
    eventually(lambda: out.exists() and len(out.read_text().split()) >= 2,
               "the next one gets its turn")
    assert gateway.ask("/")[0] == 200
    assert "is killed after 1" in gateway.log.read_text()
