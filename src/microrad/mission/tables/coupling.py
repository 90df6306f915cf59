"""The table of a mission about what takes the light at the receiver, and how well the receiver points."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from microrad.core.units import format_limit
from microrad.mission.fields import OrWord, Problem, Quantity, Share, Switch, Table
from microrad.mission.tables.pointing import AngleOrZero, JitterTable

BEST = "best"
"""What a mission writes for the mode that takes most of the light."""

_MOST_M = 1.0
_Length = Annotated[float, Quantity("m", "um", above=0.0, most=_MOST_M)]
_Offset = Annotated[float, Quantity("m", "um", least=0.0, most=_MOST_M)]
_Wavefront = Annotated[float, Quantity("m", "nm", least=-1e-3, most=1e-3)]

_NEEDS: dict[str, dict[str, str]] = {
    "single-mode fibre": {"mode_radius": f'"{BEST}"'},
    "multi-mode fibre": {"core_radius": '"25 um"', "numerical_aperture": "0.2", "focal_length": '"50 cm"'},
    "detector": {"detector_radius": '"50 um"', "focal_length": '"50 cm"'},
}
"""The keys that each end needs, with a value that could stand there."""

_POINTING = ("pointing_error", "jitter", "twin")
_ANY = ("lateral_error", "defocus", "astigmatism", "coma", "spherical", *_POINTING)


class Coupling(Table):
    """What takes the received light in the focus of the telescope."""

    into: Literal["single-mode fibre", "multi-mode fibre", "detector"] = Field(description="what takes the light")
    mode_radius_m: Annotated[float, OrWord("m", "um", above=0.0, most=_MOST_M, word=BEST)] | None = Field(
        default=None, description=f'single-mode fibre: at 1/e2 of intensity; "{BEST}" takes most of a plane wave'
    )
    core_radius_m: _Length | None = Field(default=None, description="multi-mode fibre")
    numerical_aperture: Annotated[float, Share("")] | None = Field(
        default=None, description="multi-mode fibre: sine of the half angle of its cone"
    )
    detector_radius_m: _Length | None = Field(default=None, description="detector")
    focal_length_m: Annotated[float, Quantity("m", "cm", above=0.0, most=1e4)] | None = Field(
        default=None, description="of the telescope and what stands behind it"
    )
    lateral_error_m: _Offset | None = Field(default=None, description="of the fibre or detector, off the focus")
    angular_error_rad: AngleOrZero | None = Field(default=None, description="single-mode fibre: of its axis")
    defocus_m: _Wavefront | None = Field(default=None, description="rms over the whole circle, Zernike 4 (Noll)")
    astigmatism_m: _Wavefront | None = Field(default=None, description="rms over the whole circle, Zernike 6 (Noll)")
    coma_m: _Wavefront | None = Field(default=None, description="rms over the whole circle, Zernike 8 (Noll)")
    spherical_m: _Wavefront | None = Field(default=None, description="rms over the whole circle, Zernike 11 (Noll)")
    pointing_error_rad: AngleOrZero | None = Field(
        default=None, description="of the receiving terminal, static, radial, in its worst direction"
    )
    jitter: JitterTable | None = Field(default=None, description="of the receiving terminal, in place of a static one")
    twin: Annotated[bool, Switch("")] | None = Field(
        default=None, description="true: it points as the transmitting terminal does, independently of it"
    )

    def __hash__(self) -> int:
        """Of its keys in their order."""
        return hash(tuple((name, getattr(self, name)) for name in type(self).model_fields))

    @property
    def keys_of_light(self) -> tuple[str, ...]:
        """The keys that are there and say what takes the light, and not how the receiver points."""
        there = {info.alias or name: getattr(self, name) for name, info in type(self).model_fields.items()}
        return tuple(key for key, value in there.items() if value is not None and key not in _POINTING)

    @property
    def is_random(self) -> bool:
        """Whether the receiver's pointing error has a distribution of its own."""
        return self.jitter is not None or self.twin is True

    def wavefront_problems(self, wavelength_m: float) -> Iterator[Problem]:
        """Aberrations that leave the light a core.

        Args:
            wavelength_m: Wavelength of the light (m).
        """
        for key in ("defocus", "astigmatism", "coma", "spherical"):
            if abs(getattr(self, f"{key}_m") or 0.0) > wavelength_m / 2.0:
                limit = format_limit(wavelength_m / 2.0, "m")
                reason = f"is above half the wavelength ({limit}): such light has no core to couple"
                yield Problem(f"coupling.{key}", reason, f"at most {limit}")

    def problems(self) -> Iterator[Problem]:
        """The keys of its end and no others, and one statement of the receiver's pointing."""
        needed, choice, allowed = dict(_NEEDS[self.into]), f'into = "{self.into}"', [*_ANY]
        if self.into == "single-mode fibre":
            allowed += ["angular_error", "focal_length"]
            if self.lateral_error_m or self.angular_error_rad or not math.isnan(self.mode_radius_m or math.nan):
                needed["focal_length"] = '"50 cm"'
        yield from self.choice_problems(choice, needed, allowed, _belongs)
        said = {
            "pointing_error": self.pointing_error_rad is not None,
            "jitter": self.jitter is not None,
            "twin": self.twin is True,
        }
        given = [key for key, there in said.items() if there]
        if len(given) > 1:
            yield Problem(given[0], f"stands beside {given[1]}: both say how the receiver points", "one of the two")


def _belongs(key: str) -> str:
    """The end that a key belongs to, in words."""
    return next((f'into = "{end}"' for end, keys in _NEEDS.items() if key in keys), 'into = "single-mode fibre"')
