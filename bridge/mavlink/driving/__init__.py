"""An autopilot as the base and scanner of a robot of ours, driven leg by leg by its controller."""
