"""From columns to quantities of a wheel: runs, clocks, tare, slip, torque and load."""
