"""The source paper's figures and tables beside this run: diagrams, figures, and the virtual bench behind two."""
