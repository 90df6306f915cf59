"""The fine-pointing loop: sentences, tables, data and figures of its study, and the tail of its radial error."""
