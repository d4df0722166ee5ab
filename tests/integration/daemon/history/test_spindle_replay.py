"""Hours of measured temperatures over real buses: the daemon's offsets are the model's."""

import os

import pytest

import spindle

pytestmark = pytest.mark.skipif(not spindle.is_here(), reason=spindle.MISSING)

ALL_ROWS = 7705
# Sanitizers and quick runs: fewer rows.
ROWS_MAX = int(os.environ.get("THERMOCOMP_REPLAY_ROWS", ALL_ROWS))


def test_offsets_over_modbus_tcp_are_the_model_of_every_row(lab):
    bus = spindle.modbus_bus("modbus_tcp", "ABCD",
                             ('host = "127.0.0.1"\nport = 0',
                              'host = "127.0.0.1"\nport = @sensors@'),
                             ('host = "127.0.0.1"\nport = 0\nunit = 1',
                              'host = "127.0.0.1"\nport = @cnc@\nunit = 1'))
    spindle.replay_spindle(lab, bus, min(ROWS_MAX, ALL_ROWS), 0.025)


def test_offsets_over_a_serial_line_are_the_model_of_every_row(lab):
    def line(name):
        text = f'device = "{lab.sockets / name}"\nbaud = 115200'
        return text, text + '\nparity = "even"\ninter_frame_delay_ms = 0.5'
    sensors, controller = line("sensors"), line("cnc")
    bus = spindle.modbus_bus("modbus_rtu", "CDAB", sensors,
                             tuple(text + "\nunit = 1" for text in controller))
    spindle.replay_spindle(lab, bus, min(ROWS_MAX, 1000), 0.04)
