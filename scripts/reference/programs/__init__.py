"""Programs that cases run beside the commands: they import microrad, and print what it returns."""
