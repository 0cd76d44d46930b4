"""The channel of an MHD sensor: fluid equation, spectral grid, modes, ring and thermal drift."""

from testbed.models.mhd_channel.channel import Fluid, MhdChannel, one_mode_response

__all__ = ["Fluid", "MhdChannel", "one_mode_response"]
