"""The files of a study: arrays, the manifest, and running a report again from it."""
