"""Versions of femimpact, of its compiled core and of the libraries under it, as a report of a fault needs them."""

from __future__ import annotations

import platform
import re
import sys
from importlib import metadata

from femimpact import __version__

OWN = "femimpact"
ABSENT = "not installed"


def show_versions() -> None:
    """Print the versions of femimpact, its compiled core, Python, the platform, and the libraries that are used.

    Examples
    --------
    >>> import femimpact as fi
    >>> fi.show_versions()  # doctest: +SKIP
    femimpact      0.2.0
    """
    for name, words in _versions().items():
        print(f"{name:14} {words}")


def _versions() -> dict[str, str]:
    """Name and version of everything that a result may depend on."""
    from femimpact.core.binary import build_words

    versions = {
        OWN: __version__,
        "core": build_words(),
        "python": sys.version.split()[0],
        "platform": platform.platform(),
    }
    return {**versions, **{name: version_of(name) for name in _libraries()}}


def _libraries() -> list[str]:
    """Names of the libraries that femimpact asks for, and of those that write movies and make meshes."""
    try:
        asked = metadata.requires(OWN) or []
    except metadata.PackageNotFoundError:
        # run from a checkout that is not installed
        return []
    # "numpy>=2.0.2", 'gmsh>=4.15; extra == "mesh"': a name ends before the first sign that no name has
    used = [line for line in asked if ";" not in line or line.endswith(("'mesh'", "'movie'", '"mesh"', '"movie"'))]
    return [re.split(r"[^\w.-]", line)[0] for line in used]


def version_of(name: str) -> str:
    """Version of a library; `ABSENT` where it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ABSENT
