"""The channel of an MHD sensor: fluid equation, spectral grid, modes, ring and thermal drift."""

from testbed.models.mhd_channel.channel import MhdChannel, one_mode_response
from testbed.models.mhd_channel.fluids import Fluid

__all__ = ["Fluid", "MhdChannel", "one_mode_response"]
