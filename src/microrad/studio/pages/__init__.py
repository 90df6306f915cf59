"""The pages of the studio, one a file: each has a `TITLE`, a `PATH` and a `page` that builds its body."""
