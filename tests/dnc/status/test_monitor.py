"""The monitor against real Modbus servers: dead, silent, frozen, returned; and the guard on the wire."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable

import pytest
from pymodbus.client import AsyncModbusTcpClient

from dnc.errors import SettingsRejected
from dnc.profile import Modbus
from dnc.status import monitor as monitor_module
from dnc.status.ledger import MachineStatus, Quality
from dnc.status.monitor import StatusMonitor, WriteRefused, modbus_of
from dnc.status.registers import VIRTUAL_MILL
from dnc.status.text import status_lines
from sim.control import Execution, Mode
from sim.endpoint_modbus import ModbusEnd
from sim.panel import Panel


@contextlib.asynccontextmanager
async def watching(port: int) -> AsyncIterator[StatusMonitor]:
    monitor = StatusMonitor(Modbus(port=port))
    task = asyncio.create_task(monitor.run())
    try:
        yield monitor
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@contextlib.asynccontextmanager
async def beating(end: ModbusEnd) -> AsyncIterator[ModbusEnd]:
    """A mill whose heart beats."""

    async def beat() -> None:
        while True:
            end.show(Panel(execution=Execution.ACTIVE, block=120))
            await asyncio.sleep(0.1)

    task = asyncio.create_task(beat())
    try:
        yield end
    finally:
        task.cancel()
        await asyncio.to_thread(end.stop)


async def until(monitor: StatusMonitor, wanted: Callable[[MachineStatus], bool], within_s: float) -> float:
    """How long it took until the status was as wanted."""
    begun_s = time.monotonic()
    while not wanted(monitor.status()):
        assert time.monotonic() - begun_s < within_s, monitor.status()
        await monitor.wait_for_poll(0.05)
    return time.monotonic() - begun_s


def mill(port: int = 0, panel: Panel | None = None) -> ModbusEnd:
    end = ModbusEnd("127.0.0.1", port)
    end.show(panel or Panel(execution=Execution.ACTIVE, block=120))
    end.start()
    return end


async def test_it_reads_the_mill_and_sees_it_die_and_come_back() -> None:
    """(2.1): dead within 2 s, back within 10 s."""
    end = mill()
    async with watching(end.port) as monitor:
        async with beating(end):
            await until(monitor, lambda status: status.value("execution") == "ACTIVE", 2.0)
            assert monitor.status().value("block") == 120
        await until(monitor, lambda status: status.readings["block"].quality is Quality.STALE, 2.0)
        async with beating(mill(end.port)):
            await until(monitor, lambda status: status.value("block") == 120, 10.0)


async def test_a_silent_device_is_seen_within_two_seconds() -> None:
    """(2.1, M1): it takes the connection and never answers."""

    async def swallow(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            await reader.read()
        writer.close()

    server = await asyncio.start_server(swallow, "127.0.0.1", 0)
    async with server, watching(server.sockets[0].getsockname()[1]) as monitor:
        await until(monitor, lambda status: "no answer" in status.problem, 2.0)
        assert monitor.status().problem == f"no answer from 127.0.0.1:{monitor.modbus.port}"
        assert not monitor.status().is_available


def as_if_asked_else(asked: bytes) -> bytes:
    """Coils in place of inputs, holding registers in place of input registers; as long as what was asked for."""
    count = int.from_bytes(asked[10:12], "big")
    data = bytes(-(-count // 8)) if asked[7] == 2 else b"\0\1" * count
    return (3 + len(data)).to_bytes(2, "big") + asked[6:7] + bytes([asked[7] - 1, len(data)]) + data


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (lambda asked: asked, "another length than was asked for"),
        (lambda asked: asked[:4] + b"\0\3" + asked[6:7] + bytes([asked[7] | 0x80, 2]), "exception 2, illegal address"),
        (lambda asked: asked[:4] + as_if_asked_else(asked), "to another question"),
    ],
    ids=["echo", "refuses", "another function"],
)
async def test_a_device_that_answers_nonsense_has_no_values(answer: Callable[[bytes], bytes], why: str) -> None:
    """(2.1, M4): an echo was read as twelve inputs that are off, the chain of the emergency stop among them."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while asked := await reader.read(300):
                writer.write(answer(asked))
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with server, watching(server.sockets[0].getsockname()[1]) as monitor:
        await until(monitor, lambda status: why in status.readings["execution"].problem, 2.0)
        status = monitor.status()
        assert not status.is_available
        assert why in status.problem
        assert all(reading.value is None for reading in status.readings.values())
        lines = status_lines({"machine": monitor.report(), "job": None})
    assert len(lines) == 2
    assert why in lines[0]


async def test_another_mode_program_or_an_empty_buffer_shows() -> None:
    """(2.1; faults C8, C11) What the line cannot tell: the operator went to EDIT, called another program, starves."""
    end = mill(panel=Panel(execution=Execution.ACTIVE, buffer_fill_percent=80.0, program="FINISH.MPF"))
    async with watching(end.port) as monitor:
        await until(monitor, lambda status: status.value("program") == "FINISH.MPF", 2.0)
        assert monitor.status().value("controller_mode") == "AUTOMATIC"
        assert monitor.status().value("buffer_fill_percent") == 80
        end.show(Panel(execution=Execution.READY, mode=Mode.EDIT, buffer_fill_percent=0.0, program="OTHER.MPF"))
        await until(monitor, lambda status: status.value("program") == "OTHER.MPF", 2.0)
        assert monitor.status().value("controller_mode") == "EDIT"
        assert monitor.status().value("buffer_fill_percent") == 0
    await asyncio.to_thread(end.stop)


async def test_values_of_a_control_without_power_are_bad() -> None:
    """(2.1, C9)"""
    end = mill()
    end.show(None)
    async with watching(end.port) as monitor:
        await until(monitor, lambda status: status.readings["execution"].quality is Quality.BAD, 2.0)
        assert "device failure" in monitor.status().readings["execution"].problem
    await asyncio.to_thread(end.stop)


async def test_the_virtual_mill_is_known_for_what_it_is() -> None:
    """(2.1, O7) Its values are labelled, whatever port the job is sent to."""
    end = mill()
    async with watching(end.port) as monitor:
        assert not monitor.is_simulated
        await until(monitor, lambda status: monitor.is_simulated, 2.0)
        assert "SIMULATED" in status_lines({"machine": monitor.report(), "job": None})[0]
    await asyncio.to_thread(end.stop)


async def test_a_device_with_a_map_of_its_own_is_not_asked_what_it_is() -> None:
    """(2.1) A real device gets the reads of its profile and nothing else."""
    end = mill()
    settings = Modbus(
        port=end.port, register={"block": VIRTUAL_MILL["block"], "map_version": VIRTUAL_MILL["map_version"]}
    )
    monitor = StatusMonitor(settings)
    task = asyncio.create_task(monitor.run())
    await until(monitor, lambda status: status.value("block") == 120, 2.0)
    await monitor.wait_for_poll(1.0)
    assert not monitor.is_simulated
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    await asyncio.to_thread(end.stop)


async def test_a_write_never_leaves() -> None:
    """(2.1, M10): the guard raises, and the server's trace has seen no packet."""
    end = mill()
    client = AsyncModbusTcpClient(
        "127.0.0.1", port=end.port, timeout=0.5, retries=0, reconnect_delay=0, trace_packet=monitor_module._reads_only
    )
    assert await client.connect()
    assert not (await client.read_input_registers(0, count=64)).isError()
    with pytest.raises(WriteRefused, match="function 6"):
        await client.write_register(0, 1)
    with pytest.raises(WriteRefused, match="function 15"):
        await client.write_coils(0, [True])
    client.close()
    await asyncio.to_thread(end.stop)


async def test_nothing_of_the_mill_is_writable() -> None:
    """(2.1, M10)"""
    end = mill()
    client = AsyncModbusTcpClient("127.0.0.1", port=end.port, timeout=0.5, retries=0, reconnect_delay=0)
    assert await client.connect()
    before = (await client.read_input_registers(10, count=6)).registers
    for write in (
        client.write_coil(0, True),
        client.write_coils(0, [True]),
        client.write_register(0, 1),
        client.write_registers(10, [1, 2]),
        client.readwrite_registers(read_address=0, read_count=1, write_address=0, values=[1]),
        client.mask_write_register(address=0, and_mask=0, or_mask=0xFFFF),
    ):
        assert (await write).isError()
    assert (await client.read_coils(0)).isError()
    assert (await client.read_holding_registers(0)).isError()
    assert (await client.read_input_registers(10, count=6)).registers == before
    client.close()
    await asyncio.to_thread(end.stop)


async def test_garbage_on_the_port_does_not_stop_the_mill() -> None:
    """(2.1, M12)"""
    end = mill()
    for garbage in (b"\0" * 400, b"GET / HTTP/1.1\r\n\r\n", b"\0\1\0\0\xff\xff\1\4" + b"\xff" * 300, b"\0\1\0\0\0\2\1"):
        _, writer = await asyncio.open_connection("127.0.0.1", end.port)
        writer.write(garbage)
        await writer.drain()
        writer.close()
    async with watching(end.port) as monitor:
        await until(monitor, lambda status: status.value("execution") == "ACTIVE", 2.0)
    await asyncio.to_thread(end.stop)


def test_an_address_that_is_taken_is_one_sentence() -> None:
    """(2.7)"""
    end = mill()
    with pytest.raises(
        SettingsRejected, match="cannot listen there, it is taken, or no address of this computer; choose"
    ):
        mill(end.port)
    end.stop()


@pytest.mark.parametrize("address", ["here", ":5020", "host:", "host:x", "host:70000"])
def test_an_address_that_is_none(address: str) -> None:
    """(2.7)"""
    with pytest.raises(SettingsRejected, match="is not HOST:PORT"):
        modbus_of(Modbus(), address)
