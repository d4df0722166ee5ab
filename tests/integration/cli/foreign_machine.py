"""Devices of a machine made with pymodbus: thermocouple modules on one port, a PLC on another. The
room is at 20 degC; a module's channels are tenths of a degree.

    foreign_machine.py MODULES_PORT PLC_PORT [GATEWAY_PORT]

Unit 3: like WAGO's 750-458 (input registers 0 to 7, 32767: broken): three thermocouples, five open
channels. Unit 4: without a preset, float32 with the low word first in holding registers 100 to 103.
Requests to other units get no answer; at the third port, the same modules are behind a gateway that
answers for missing units (exception 11), so that a search takes no timeouts.
PLC, unit 1: docs/controllers/plc.md. Inputs 0 and 1 show holding registers 0 and 1 while valid bit
0 is set and the heartbeat changes, input 6 a feed, input 26 a spindle speed; no other input
registers exist.
"""

import asyncio
import struct
import sys

from pymodbus.datastore import (ModbusSequentialDataBlock, ModbusServerContext,
                                ModbusSlaveContext, ModbusSparseDataBlock)
from pymodbus.server import StartAsyncTcpServer

OPEN = 32767


def slave(inputs=None, holdings=None):
    def block(values):
        if isinstance(values, ModbusSparseDataBlock):
            return values
        words = [0] * 200
        for address, word in (values or {}).items():
            words[address] = word
        return ModbusSequentialDataBlock(0, words)

    return ModbusSlaveContext(di=ModbusSequentialDataBlock(0, [0] * 200),
                              co=ModbusSequentialDataBlock(0, [0] * 200), hr=block(holdings),
                              ir=block(inputs), zero_mode=True)


def float_low_word_first(value):
    high, low = struct.unpack(">2H", struct.pack(">f", value))
    return low, high


class Gateway(ModbusServerContext):
    def slaves(self):
        return list(range(1, 248))


def modules(kind=ModbusServerContext):
    broken = {channel: OPEN for channel in range(8)}
    wago = slave(inputs={**broken, 0: 201, 1: 203, 4: 198})
    low, high = float_low_word_first(20.25)
    low2, high2 = float_low_word_first(20.5)
    other = slave(holdings={100: low, 101: high, 102: low2, 103: high2})
    return kind(slaves={3: wago, 4: other}, single=False)


async def act(plc):
    """PLC cycle of 10 ms: applies the offset only while the daemon's heartbeat changes."""
    heartbeat, silent_turns, turn_s = None, 0, 0.01
    while True:
        valid, beat = plc.getValues(3, 10, 2)
        silent_turns = silent_turns + 1 if beat == heartbeat else 0
        if heartbeat is not None and silent_turns < 1.0 / turn_s and valid & 1:
            plc.setValues(4, 0, plc.getValues(3, 0, 2))
        heartbeat = beat
        await asyncio.sleep(turn_s)


async def main():
    plc = slave(inputs=ModbusSparseDataBlock({0: 0, 1: 0, 2: 0, 3: 0, 6: 120, 26: 3000}))
    ports = [int(port) for port in sys.argv[1:4]]
    contexts = modules(), ModbusServerContext(slaves={1: plc}, single=False), modules(Gateway)
    servers = [StartAsyncTcpServer(context=context, address=("127.0.0.1", port))
               for context, port in zip(contexts, ports)]
    await asyncio.gather(act(plc), *servers)


if __name__ == "__main__":
    asyncio.run(main())
