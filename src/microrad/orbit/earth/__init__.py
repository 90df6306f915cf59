"""The Earth that everything counts from: its figure and gravity, how far it has turned, and where the Sun stands."""
