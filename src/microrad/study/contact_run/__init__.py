"""One contact in the time domain: slew, beacon, detection, answer, lock, data, loss and re-acquisition.

What is taken for granted:

- The stages of an acquisition are those of `link.acquisition`, with the light time of the beacon's distance.
- The fine loop is simulated in sampled windows of the data phase. Between them the state holds: a contact that has
  lock at the end of a window keeps it up to the next one. A window follows each re-acquisition, so that what is lost at
  once is not counted as data; what is lost once in minutes is seen only by chance (`ContactRun.losses_per_s`).
- A window is one run of the loop from rest, settled before it begins, in random streams of its own. Range, point-ahead
  and rate are straight lines over it. The body has long followed the line of sight, and its lag is settled.
- Axis x lies along the motion of the line of sight, as in the mission: point-ahead and rate are both positive on it.
- The receiver's power is that of the moment of sending. What a correction of the point-ahead leaves is not in it.
"""

from microrad.study.contact_run.records import ContactRun, State
from microrad.study.contact_run.sequence import of_mission

__all__ = ["ContactRun", "State", "of_mission"]
