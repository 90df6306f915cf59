"""The mirror as one plant form: its model, hysteresis, geometry, what it can do and how well it is known."""
