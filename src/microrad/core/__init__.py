"""The ground that knows no mission: units, budget lines, linear systems, files, threads, compiled loops, kept parts."""
