import pytest

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.io_banks import BANK_NAMES, MAX_ANALOG, IoBanks

OUTPUT_SIZES = {"digital": (135, 8, 64, 3, 128, 64, 64), "analog": (64, 2, 64, 0, 64, 64, 48)}
INPUT_SIZES = {"digital": (135, 8, 64, 0, 128, 64, 64), "analog": (64, 2, 64, 0, 64, 64, 48)}


@pytest.mark.parametrize("output, sizes", [(True, OUTPUT_SIZES), (False, INPUT_SIZES)])
@pytest.mark.parametrize("signal", ["digital", "analog"])
@pytest.mark.parametrize("bank", range(len(BANK_NAMES)))
def test_each_terminal_keeps_its_value_and_there_are_no_others(signal, output, sizes, bank):
    io, size = IoBanks(FIRMWARES["1.5.14"]), sizes[signal][bank]
    for index in (0, size - 1) if size else ():
        io.set(signal, output, bank, index, 1)
        assert io.get(signal, output, bank, index) == 1
    for index in (-1, size):
        with pytest.raises(InvalidCommand):
            io.get(signal, output, bank, index)
        with pytest.raises(InvalidCommand):
            io.set(signal, output, bank, index, 1)


def test_no_other_bank_or_signal():
    io = IoBanks(FIRMWARES["1.7"])
    for signal, bank in (("digital", 7), ("digital", -1), ("sound", 0)):
        with pytest.raises(InvalidCommand):
            io.get(signal, True, bank, 0)


def test_array_is_the_same_object_until_it_changes():
    io = IoBanks(FIRMWARES["1.7"])
    before = io.array("dout")
    io.set("digital", False, 0, 3, 1)
    assert io.array("dout") is before and len(before) == 144
    io.set("digital", True, 0, 3, 5)
    assert io.array("dout")[3] == 1 and before[3] == 0


def test_analog_values_are_rounded_and_bounded():
    io = IoBanks(FIRMWARES["1.7"])
    io.set("analog", True, 0, 1, 1.23456789)
    assert io.get("analog", True, 0, 1) == 1.23457
    with pytest.raises(InvalidCommand):
        io.set("analog", True, 0, 1, MAX_ANALOG + 1.0)
    assert io.get("analog", True, 0, 1) == 1.23457
