"""What disturbs the light on its way to a reading: one concept a file, and no code on the path unless a scene names it.

An effect is a section of the scene that puts itself into the world: it wraps the one function that it disturbs.
"""

from sim_devices.effects.measurement import SAMPLE_S

__all__ = ["SAMPLE_S"]
