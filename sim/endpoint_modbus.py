"""The mill's status over Modbus TCP: a thread of its own with its own loop; it serves whole images and takes nothing.

Each request is answered from one image, so that 32-bit values cannot be torn. Nothing is writable: coils and holding
registers do not exist, and a write to anything is answered with an exception.
"""

from __future__ import annotations

import asyncio
import threading
from typing import cast

from pymodbus import ModbusDeviceIdentification, pymodbus_apply_logging_config
from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from planner.errors import SettingsRejected
from sim.panel import DISCRETE_INPUTS, INPUT_REGISTERS, Panel, discrete_inputs, input_registers

_IDENTITY = ModbusDeviceIdentification(  # type: ignore[no-untyped-call]
    info_name={"VendorName": "dripmill", "ProductCode": "SIMULATED", "ProductName": "virtual mill"}
)
"""Whoever reads the map can find out that no real machine stands behind it."""


class ModbusEnd:
    """Serves what it was shown last; `port` is the one it got, once it is started."""

    def __init__(self, host: str, port: int) -> None:
        self.host, self.port = host, port
        self._heartbeat = 0
        self._words = [0] * INPUT_REGISTERS
        self._bits = [False] * DISCRETE_INPUTS
        self._is_mute = True
        self._loop = asyncio.new_event_loop()
        self._stop = asyncio.Event()
        self._started = threading.Event()
        self._problem: str | None = None
        self._thread = threading.Thread(target=self._run, name="modbus", daemon=True)

    def start(self) -> None:
        """Bind and serve; raises SettingsRejected if the address is taken or not ours."""
        self._thread.start()
        self._started.wait()
        if self._problem is not None:
            raise SettingsRejected(
                f"--modbus {self.host}:{self.port}: cannot listen there, {self._problem}",
                remedy="choose another port, or 0 for any free one",
            )

    def show(self, panel: Panel | None) -> None:
        """From now on this is what the mill shows; the heartbeat goes up by one. None: without power, no answer."""
        self._is_mute = panel is None
        if panel is not None:
            self._heartbeat = (self._heartbeat + 1) % 65536
            self._words = input_registers(panel, self._heartbeat)
            self._bits = discrete_inputs(panel)

    def stop(self) -> None:
        """Close all connections and end the thread."""
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        pymodbus_apply_logging_config("CRITICAL")
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        try:
            server = ModbusTcpServer(self._device(), identity=_IDENTITY, address=(self.host, self.port))
            await server.serve_forever(background=True)
        except (
            OSError,
            RuntimeError,
        ):  # whose words are the library's: "Could not start listen, please check address."
            self._problem = "it is taken, or no address of this computer"
            self._started.set()
            return
        self.port = cast("asyncio.Server", server.transport).sockets[0].getsockname()[1]
        self._started.set()
        await self._stop.wait()
        await server.shutdown()  # type: ignore[no-untyped-call]

    def _device(self) -> SimDevice:
        """The map: discrete inputs and input registers; the other two kinds hold one place that refuses all."""
        bits = SimData(0, values=0, count=1, datatype=DataType.BITS, readonly=True)
        words = SimData(0, values=0, count=INPUT_REGISTERS, datatype=DataType.REGISTERS, readonly=True)
        nothing = SimData(0, values=0, count=1, datatype=DataType.REGISTERS, readonly=True)
        return SimDevice(id=1, simdata=([bits], [bits], [nothing], [words]), action=self._answer)

    async def _answer(
        self,
        function_code: int,
        start_address: int,
        address: int,
        count: int,
        current_registers: list[int],
        set_values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        """Called by the server before each answer: put the newest image under it, or refuse."""
        del start_address, address, count
        if set_values is not None or function_code not in (2, 4):
            return ExcCodes.ILLEGAL_FUNCTION
        if self._is_mute:
            return ExcCodes.DEVICE_FAILURE
        if function_code == 2:
            current_registers[0] = sum(1 << place for place, is_set in enumerate(self._bits) if is_set)
        else:
            current_registers[:] = self._words
        return None
