"""The checks of a recording: of its sample rate, of each channel by itself, and of drive and output together."""
