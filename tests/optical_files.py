"""Tables of optical ground stations for missions of tests: a network under clouds, and stations of a constellation."""

KIRUNA_SITE = {"latitude": "67.86 deg", "longitude": "20.96 deg", "height": "400 m", "mask": "5 deg"}
TROMSO_SITE = {"latitude": "69.66 deg", "longitude": "18.94 deg", "height": "100 m", "mask": "5 deg"}
TENERIFE_SITE = {"latitude": "28.3 deg", "longitude": "-16.5 deg", "height": "2400 m", "mask": "10 deg"}
SITES = {"kiruna": KIRUNA_SITE, "tromso": TROMSO_SITE, "tenerife": TENERIFE_SITE}


def optical(availability, **given):
    """[operations.optical] over `SITES`; ``availability`` is one for all or one for each, by name."""
    each = availability if isinstance(availability, dict) else dict.fromkeys(SITES, availability)
    table = {
        "data_rate": "100 Mbit/s",
        "setup": "30 s",
        "delay": "1 s",
        "weather": "2 h",
        "correlation_length": "500 km",
        "stations": {name: {**SITES[name], "availability": share} for name, share in each.items()},
    }
    return {"operations.optical": table | given}


def shared_stations(*names, **given):
    """[constellation.stations] of some of `SITES`."""
    own = {"data_rate": "1 Gbit/s", "terminals": 1, "availability": 1.0} | given
    return {"constellation.stations": {name: {**SITES[name], **own} for name in names}}
