"""The build hook of hatchling: compiles the core into the package, for wheels and for editable installs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, NoReturn

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# the package that is built, which is not installed; it imports nothing but the standard library for this
ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from femimpact.core import compilation  # noqa: E402
from femimpact.core.compilation import CompilationError  # noqa: E402

sys.path.remove(str(ROOT))


class CustomBuildHook(BuildHookInterface[Any]):
    """Compiles the core before files are collected."""

    def dependencies(self) -> list[str]:
        """Zig of the package index, where nothing else compiles."""
        try:
            return [compilation.zig_requirement()] if compilation.needs_zig(ROOT, compilation.asked_kind()) else []
        except CompilationError as error:
            _stop(error)

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and say for which platform the wheel is."""
        try:
            kind = compilation.asked_kind()
            if version != "editable" and kind in ("checked", "sanitized"):
                raise CompilationError(
                    f"FEMIMPACT_BUILD = {kind!r}: no wheel is made of it, only an editable install (pip install -e .)"
                )
            compilation.build(ROOT, kind, self.app.display_info)
        except CompilationError as error:
            _stop(error)
        build_data["pure_python"] = False
        build_data["tag"] = compilation.wheel_tag()


def _stop(error: Exception) -> NoReturn:
    """End the build with the error's words, without a traceback."""
    sys.exit(f"femimpact: {error}")
