"""Coded error rate of a link over a series of relative received power, imported or from a simulated residual.

`records` has the series and its fades, `reader` reads one from a file, `codes` what a code makes of the powers of its
symbols, and `coded` the error ratio, the words lost and what the fades cost.
"""

from microrad.link.fade_series.coded import CodedFading, CodedLink, SpanPenalty, coded_fading
from microrad.link.fade_series.codes import Convolutional, Threshold, code
from microrad.link.fade_series.reader import read_fade_series
from microrad.link.fade_series.records import Fades, FadeSeries, FadeSeriesError

__all__ = [
    "CodedFading",
    "CodedLink",
    "Convolutional",
    "FadeSeries",
    "FadeSeriesError",
    "Fades",
    "SpanPenalty",
    "Threshold",
    "code",
    "coded_fading",
    "read_fade_series",
]
