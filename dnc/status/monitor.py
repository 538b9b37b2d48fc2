"""Reads a machine over Modbus TCP on its own schedule; it can only read, and it says so on the wire.

One task polls; whoever wants to know asks `status`. The client library's own retries and reconnects are off: a dead
device shows within two seconds and a returned one within ten, whatever happened before.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from pymodbus import ModbusException, pymodbus_apply_logging_config
from pymodbus.client import AsyncModbusTcpClient
from pymodbus.pdu import ModbusPDU

from dnc.errors import SettingsRejected
from dnc.profile import Modbus
from dnc.status.ledger import Ledger, MachineStatus, Trust
from dnc.status.registers import VIRTUAL_MILL, Place, Request, requests

READ_FUNCTIONS = frozenset({1, 2, 3, 4})
_IDENTIFY = b"\x2b\x0e"
"""Read device identification: function 43, kind 14 (Modbus Application Protocol V1.1b3, 6.21)."""
_PRODUCT_CODE = 1
EXCEPTIONS = {1: "illegal function", 2: "illegal address", 3: "illegal value", 4: "device failure", 6: "device busy"}


@dataclass(frozen=True, slots=True)
class Schedule:
    """How often and how long; seconds."""

    poll_s: float = 0.25
    timeout_s: float = 0.5
    first_wait_s: float = 0.25
    longest_wait_s: float = 5.0
    trust: Trust = field(default_factory=lambda: Trust(stale_s=0.9, lost_s=10.0, heartbeat_s=1.0))


class WriteRefused(AssertionError):
    """Something tried to send a Modbus function that is not a read; nothing left."""


class StatusMonitor:
    """Polls one device for ever; construct and run inside an event loop."""

    def __init__(
        self, modbus: Modbus, schedule: Schedule | None = None, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self.modbus = modbus
        self.schedule = schedule or Schedule()
        self.is_simulated = False
        registers = modbus.register or VIRTUAL_MILL
        self.ledger = Ledger(registers, self.schedule.trust)
        self.requests = requests(registers.values())
        self._monotonic = monotonic
        self._polled = asyncio.Event()
        pymodbus_apply_logging_config("CRITICAL")

    def status(self) -> MachineStatus:
        """Everything as it stands at this moment."""
        return self.ledger.status(self._monotonic())

    def report(self) -> dict[str, Any]:
        """The machine's part of a status report, with wall times."""
        status, now_s, wall_s = self.status(), self._monotonic(), time.time()
        read_at = {
            name: datetime.fromtimestamp(wall_s - now_s + reading.read_s, UTC).isoformat(timespec="milliseconds")
            for name, reading in status.readings.items()
            if reading.read_s is not None
        }
        place = {"host": self.modbus.host, "port": self.modbus.port, "simulated": self.is_simulated}
        return {**place, **status.report(read_at)}

    async def wait_for_poll(self, timeout_s: float) -> None:
        """Until the next poll has ended, well or not."""
        self._polled.clear()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._polled.wait(), timeout_s)

    async def run(self) -> None:
        """Connect, poll, and connect again, until cancelled."""
        wait_s = self.schedule.first_wait_s
        while True:
            client = self._client()
            try:
                if await self._connect(client):
                    wait_s = self.schedule.first_wait_s
                    await self._poll_while_connected(client)
            finally:
                client.close()
            self.ledger.reconnects += 1
            self._polled.set()
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, self.schedule.longest_wait_s)

    def _client(self) -> AsyncModbusTcpClient:
        return AsyncModbusTcpClient(
            self.modbus.host,
            port=self.modbus.port,
            timeout=self.schedule.timeout_s,
            retries=0,
            reconnect_delay=0,
            trace_packet=_reads_only,
        )

    async def _connect(self, client: AsyncModbusTcpClient) -> bool:
        try:
            is_connected = await asyncio.wait_for(client.connect(), self.schedule.timeout_s)
        except (OSError, TimeoutError):
            is_connected = False
        if not is_connected:
            self.ledger.failed(f"nothing answers at {self.modbus.host}:{self.modbus.port}")
        return is_connected

    async def _identify(self, client: AsyncModbusTcpClient) -> None:
        """Find out whether the virtual mill answers."""
        known: dict[int, bytes] = {}
        with contextlib.suppress(ModbusException, OSError, TimeoutError):
            answer = await client.read_device_information(device_id=self.modbus.device_id)
            known = getattr(answer, "information", {})  # an exception has none
        self.is_simulated = known.get(_PRODUCT_CODE) == b"SIMULATED"

    async def _poll_while_connected(self, client: AsyncModbusTcpClient) -> None:
        """Poll until the device is gone or silent; silence drops the connection, so no late answer can confuse."""
        due_s = self._monotonic()
        is_asked = bool(self.modbus.register)  # a map of its own is a real device's: it is not troubled
        while client.connected:
            try:
                image, refused = await self._read_all(client)
            except (ModbusException, OSError, TimeoutError) as problem:
                reason = f" ({problem.strerror})" if isinstance(problem, OSError) and problem.strerror else ""
                self.ledger.failed(f"no answer from {self.modbus.host}:{self.modbus.port}{reason}")
                return
            self.ledger.answered(image, refused, self._monotonic())
            if not is_asked and self.status().value("map_version") is not None:
                is_asked = True
                await self._identify(client)
            self._polled.set()
            due_s = max(due_s + self.schedule.poll_s, self._monotonic())
            await asyncio.sleep(due_s - self._monotonic())
        self.ledger.failed(f"{self.modbus.host}:{self.modbus.port} closed the connection")

    async def _read_all(self, client: AsyncModbusTcpClient) -> tuple[dict[Place, int], dict[Place, str]]:
        image: dict[Place, int] = {}
        refused: dict[Place, str] = {}
        for request in self.requests:
            answer = await self._read(client, request)
            places = [(request.function, request.address + index) for index in range(request.count)]
            if answer.isError():
                code = answer.exception_code
                refused |= dict.fromkeys(places, f"exception {code}, {EXCEPTIONS.get(code, 'unknown')}")
                continue
            if answer.function_code != request.function:
                refused |= dict.fromkeys(places, "the answer is to another question than was asked")
                continue
            is_bits = request.function in (1, 2)
            values = answer.bits if is_bits else answer.registers
            if len(values) != (-(-request.count // 8) * 8 if is_bits else request.count):
                refused |= dict.fromkeys(places, "the answer has another length than was asked for")
                continue
            image |= {place: int(value) for place, value in zip(places, values, strict=False)}
        return image, refused

    async def _read(self, client: AsyncModbusTcpClient, request: Request) -> ModbusPDU:
        read = {
            1: client.read_coils,
            2: client.read_discrete_inputs,
            3: client.read_holding_registers,
            4: client.read_input_registers,
        }[request.function]
        return await read(request.address, count=request.count, device_id=self.modbus.device_id)


def modbus_of(modbus: Modbus, address: str | None) -> Modbus:
    """The profile's Modbus settings, with host and port replaced by HOST:PORT where that is given."""
    if address is None:
        return modbus
    host, colon, port = address.rpartition(":")
    if not colon or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise SettingsRejected(f"--modbus {address}: is not HOST:PORT", remedy="write 127.0.0.1:5020")
    return Modbus(host=host, port=int(port), device_id=modbus.device_id, register=modbus.register)


def _reads_only(is_sending: bool, data: bytes) -> bytes:
    """The guard on the wire: no function code but reads leaves this process."""
    if is_sending and (len(data) < 8 or not (data[7] in READ_FUNCTIONS or data[7:9] == _IDENTIFY)):
        raise WriteRefused(f"refused to send Modbus function {data[7] if len(data) > 7 else '?'}")
    return data
