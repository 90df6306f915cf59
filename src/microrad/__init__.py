"""microrad."""
