"""HDR light on ordinary displays: the EETF of ITU-R BT.2390-11, section 5.4.1, on R, G and B."""

import numpy as np

from ..base.arrays import Floats

WHITE = 203.0
"""cd/m2 of diffuse white, which is 1 in our light, and the brightest of the display (ITU-R BT.2408)."""
PEAK = 1000.0
"""cd/m2 that become the display's brightest: HLG's nominal peak, and that of the usual PQ master."""


def tone_mapped(light: Floats) -> Floats:
    """Return light (...) of 0 to `PEAK` cd/m2, in which white is 1, as that of a display up to 1.

    Below a knee at 0.44, for 1,000 cd/m2, nothing changes; white becomes 0.78.
    """
    top, limit = _pq(PEAK), _pq(WHITE)
    least = limit / top
    knee = 1.5 * least - 0.5
    signal = np.minimum(_pq(np.maximum(light, 0) * WHITE) / top, 1)
    t = np.maximum(signal - knee, 0) / (1 - knee)
    spline = (
        (2 * t**3 - 3 * t**2 + 1) * knee + (t**3 - 2 * t**2 + t) * (1 - knee) + (3 * t**2 - 2 * t**3) * least
    )
    return np.asarray(np.where(signal < knee, light, _nits(spline * top) / WHITE))


def _pq(nits: Floats | float) -> Floats:
    """SMPTE ST 2084's signal in [0, 1] of light in cd/m2."""
    power = (np.asarray(nits) / 10000) ** (2610 / 16384)
    return np.asarray(((3424 / 4096 + 2413 / 128 * power) / (1 + 2392 / 128 * power)) ** (2523 / 32))


def _nits(signal: Floats) -> Floats:
    """Its inverse."""
    power = signal ** (32 / 2523)
    ratio = np.maximum(power - 3424 / 4096, 0) / (2413 / 128 - 2392 / 128 * power)
    return np.asarray(10000 * ratio ** (16384 / 2610))
