"""A bench of two axes whose numbers are all unlike each other, as the begin of a plan."""

LIMITS_AND_BENCH = """\
[limits]
rate = "622.08 Hz"
drive_min = "-3 V"
drive_max = "9 V"
slew = "700 V/s"
samples_per_period = 4.5
[bench]
truth = "linear"
axes = 2
crosstalk = -0.25
[bench.amplifier]
gain = 12.5
output_min = "-50 V"
output_max = "125 V"
bandwidth = "4 kHz"
slew = "0.5 V/us"
[bench.converters]
bits = 14
drive_min = "-3.5 V"
drive_max = "9.5 V"
output_min = "-2 mrad"
output_max = "3 mrad"
[bench.sensor]
noise_share = 0.02
mains = "3 urad"
mains_frequency = "60 Hz"
"""
