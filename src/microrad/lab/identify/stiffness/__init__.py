"""One mirror for all amplitudes: linear modes in feedback with hysteresis, fitted to multisines."""
