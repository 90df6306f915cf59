"""A linear mirror model of another tool, as the text of a mirror file."""

from microrad.export.linear_import.mirror_file import Given, import_control, import_mat

__all__ = ["Given", "import_control", "import_mat"]
