"""The budget of pointing errors: its tables, figures and plain data."""
