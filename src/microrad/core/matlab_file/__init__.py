"""Reader of MATLAB files of version 5 to 7, which takes nothing that a file says for true before its bytes are there.

It is written here because a file from elsewhere may be damaged or hostile: the reader of SciPy 1.17 ends the process on
some of them. Nothing in a file is executed; what a file may ask for in memory, depth and number is bounded. Numbers may
be left in the file and read one array at a time. Source of the format: MAT-File Format, MathWorks, chapter 1.
"""

from microrad.core.matlab_file.reader import MOST_ARRAYS, MOST_DEPTH, MatlabFile
from microrad.core.matlab_file.records import Left, MatlabFileError, Structure, Unread

__all__ = ["MOST_ARRAYS", "MOST_DEPTH", "Left", "MatlabFile", "MatlabFileError", "Structure", "Unread"]
