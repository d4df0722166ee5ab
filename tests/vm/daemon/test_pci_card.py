"""Emulated PCI CAN cards: link down and up, a card removed and found again. The daemon is on can0,
its machine on can1; both cards are on one bus."""

import pathlib

import pytest

import rig as rigs
from lab import Lab, eventually
from rig import ip, set_up

CARD, PEER = "can0", "can1"
pytestmark = pytest.mark.skipif(not pathlib.Path(f"/sys/class/net/{PEER}/device").exists(),
                                reason="there are no CAN cards (tests/vm/run_in_vm.sh --emulated)")


def configure(interface):
    ip("set", interface, "type", "can", "bitrate", "500000", "restart-ms", "100")


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    lab = Lab(tmp_path_factory.mktemp("card"))
    try:
        for interface in (CARD, PEER):
            configure(interface)
            set_up(interface)
        made = rigs.Rig(lab, (CARD, CARD), (PEER, PEER))
        yield made
        for recovery in made.finish():
            print(recovery)
            assert recovery.held_um == 0.0, str(recovery)
    finally:
        lab.end()


def test_link_down_and_up(rig):
    def begin():
        ip("set", CARD, "down")
        eventually(lambda: rig.bus("body")["state"] == "down", "the state is reported")
        eventually(lambda: rig.bus("body")["last_error"].startswith(CARD), "and why")

    rig.outage("link down, up (kvaser_pci)", "both", begin, lambda: set_up(CARD))


def test_card_removed_and_found_again(rig):
    card = pathlib.Path(f"/sys/class/net/{CARD}/device").resolve()

    def begin():
        (card / "remove").write_text("1")
        assert not pathlib.Path(f"/sys/class/net/{CARD}").exists()

    def prepare():
        pathlib.Path("/sys/bus/pci/rescan").write_text("1")
        eventually(lambda: pathlib.Path(f"/sys/class/net/{CARD}").exists(), "the card is found")
        configure(CARD)

    rig.outage("card removed, rescan (kvaser_pci)", "both", begin, lambda: set_up(CARD), prepare)
    eventually(lambda: rig.bus("body")["connects"] >= 3, "both times a new connection")
