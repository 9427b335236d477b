"""The limits of the tests of automatic emergency braking: Euro NCAP's colours and UN Regulation 152.

Euro NCAP: protocol of 2026 (Crash Avoidance, Frontal Collisions, section 5.2, as the rating calculator that Euro NCAP
publishes, euroncap-rating-2026 5.4.9, has them).
"""

from __future__ import annotations

from pipeline.evaluation.report_sections import Tone

BANDS: tuple[tuple[float, tuple[tuple[float, Tone], ...]], ...] = (
    (50.0, ((10.0, "yellow"), (20.0, "orange"), (30.0, "brown"))),
    (40.0, ((10.0, "orange"), (20.0, "brown"))),
    (30.0, ((10.0, "brown"),)),
    (0.0, ()),
)
"""For each ego speed and above, in km/h: the relative impact speeds, in km/h, below which each colour applies. Green is
an avoided collision, red is everything else. The protocol tests every 10 km/h; in between, the bands of the lower speed
apply."""
R152_LIMITS: tuple[tuple[float, float], ...] = ((42.0, 0.0), (45.0, 15.0), (50.0, 25.0), (55.0, 30.0), (60.0, 35.0))
"""UN R152, 5.2.1.4, category M1 unladen: for relative speeds up to the first number, the impact speed may not exceed
the second; both in km/h."""


def impact_tone(speed_kmh: float, impact_kmh: float) -> Tone:
    """Euro NCAP's colour for a relative impact speed at this ego speed; 0 is an avoided collision."""
    if impact_kmh <= 0.0:
        return "green"
    bands = next(bands for from_kmh, bands in BANDS if speed_kmh >= from_kmh)
    return next((colour for limit, colour in bands if impact_kmh < limit), "red")


def r152_limit_kmh(relative_kmh: float) -> float | None:
    """The permitted impact speed; None beyond the speeds that the Regulation covers."""
    return next((limit for up_to, limit in R152_LIMITS if relative_kmh <= up_to), None)
