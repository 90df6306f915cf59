"""The mirror, or a closed loop with it, as a co-simulation unit (FMU)."""
