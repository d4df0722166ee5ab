"""A thermocouple module made with pymodbus, on TCP or a serial port.

    foreign_module.py tcp PORT | rtu DEVICE BAUD

Input registers: four floats 23.4375 in the word orders ABCD, DCBA, BADC, CDAB at 0, 2, 4, 6; int16
tenths of a degree at 20: 215, -57, 32767 (open circuit), 1. Holding registers: a float64 at 0.
Discrete inputs: second channel broken. Floats are packed by pymodbus if possible.
"""
import sys

from pymodbus.constants import Endian
from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.payload import BinaryPayloadBuilder
from pymodbus.server import StartSerialServer, StartTcpServer
from pymodbus.transaction import ModbusRtuFramer

TEMPERATURE = 23.4375


def registers_of(byte_order, word_order, add):
    builder = BinaryPayloadBuilder(byteorder=byte_order, wordorder=word_order)
    add(builder)
    return builder.to_registers()


def byte_swapped(words):
    return [((word & 0xFF) << 8) | (word >> 8) for word in words]


def context():
    def temperature(builder):
        builder.add_32bit_float(TEMPERATURE)

    abcd = registers_of(Endian.Big, Endian.Big, temperature)
    cdab = registers_of(Endian.Big, Endian.Little, temperature)
    inputs = [0] * 100
    inputs[0:8] = abcd + byte_swapped(cdab) + byte_swapped(abcd) + cdab
    inputs[20:24] = [215, 0x10000 - 57, 32767, 1]
    holdings = [0] * 100
    holdings[0:4] = registers_of(Endian.Big, Endian.Big, lambda b: b.add_64bit_float(-12.625))
    bits = [0, 1, 0, 0] + [0] * 12
    slave = ModbusSlaveContext(
        di=ModbusSequentialDataBlock(0, bits), co=ModbusSequentialDataBlock(0, [0] * 16),
        hr=ModbusSequentialDataBlock(0, holdings), ir=ModbusSequentialDataBlock(0, inputs),
        zero_mode=True)
    return ModbusServerContext(slaves={5: slave}, single=False)


def main():
    if sys.argv[1] == "tcp":
        StartTcpServer(context=context(), address=("127.0.0.1", int(sys.argv[2])))
    else:
        StartSerialServer(context=context(), framer=ModbusRtuFramer, port=sys.argv[2],
                          baudrate=int(sys.argv[3]), timeout=0.05)


if __name__ == "__main__":
    main()
