"""A driver for a data acquisition card, as `hapticeval record --device my_card:MyCard --wiring rig.toml` takes it.

`daq` stands for your card's own library: replace its calls. Readings and commands are raw; the [device] table of
rig.toml says what they mean, and without one no driver is run. The smallest, of a driver that gives joint angles in rad
and takes torques in N m, is

    [device]
    kind = "parallelogram-2dof"
"""

import time

import daq
import numpy as np

from hapticeval import Reading


class MyCard:
    """Two encoders and two motors at 1 kHz."""

    def __init__(self):
        self.card = daq.open("/dev/daq0", rate=1000.0)

    def read(self):
        """Wait for the card's tick; it counts those that we missed."""
        count = self.card.wait_for_tick(timeout=1.0)
        return Reading(time.monotonic_ns(), count, np.array(self.card.encoders(), dtype=float))

    def write(self, command):
        """V, A or N m: see torque_per_command."""
        self.card.analog_out(command)

    def close(self):
        """The motors have been commanded to zero."""
        self.card.close()
