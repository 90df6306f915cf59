"""The tables of a mission file: their keys, units and bounds, and what must fit within each."""
