"""Export: flight code, co-simulation units and matrices of a design; import of linear models.

`choice` takes a mission and gives one of its controllers as numbers (`records`). `linear_part` brings it into small
blocks, `flight` writes it as C, `fmi` as a co-simulation unit, and `matrices` as linear models for other tools.
`linear_import` makes a mirror file of a linear model. The files that are written stand in `templates`.
"""
