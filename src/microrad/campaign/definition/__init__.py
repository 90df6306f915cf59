"""What a campaign file defines: its tables, keys of the mission, distributions, cells and limits, all checked."""
