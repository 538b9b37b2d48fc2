"""Machine status over Modbus: the register map and the monitor that polls it."""
