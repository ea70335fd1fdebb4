"""A step for scripts."""

from __future__ import annotations

from dataclasses import dataclass

from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver


@dataclass(frozen=True)
class Count(Step):
    """Say how many features are placed on both sides; fail where they are fewer than `least`."""

    do = "count"

    least: int = 0

    def run(self, driver: WindowDriver) -> str | None:
        """Count them."""
        from gp_core import GpError, Side

        state = driver.workspace.document.state
        n = sum(len(state.side(side).placed) for side in Side)
        if n < self.least:
            raise GpError(f"{n} features are placed, and {self.least} were asked for")
        return f"{n} placed"
