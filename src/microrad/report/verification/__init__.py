"""How well the printed figures are founded in this installation: a register of them, and evidence that is run here."""
