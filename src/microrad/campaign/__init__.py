"""Many runs of a mission: drawn inputs, a ledger that survives anything, and what the rows say together."""
