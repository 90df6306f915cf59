"""What published standards ask of a terminal, a requirement each, against what a mission's links have."""

from microrad.link.compliance.judge import Compliance, Held, Judgement, compliance
from microrad.link.compliance.standards import Asked, Standard, standard, standards

__all__ = ["Asked", "Compliance", "Held", "Judgement", "Standard", "compliance", "standard", "standards"]
