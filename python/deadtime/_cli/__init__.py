"""The ``deadtime`` command."""

from __future__ import annotations

import importlib.util
import sys

from deadtime._cli.interruption import INTERRUPTED, SAID, ended_by_ctrl_c

__all__ = ["main"]

EXTRAS = ("rich", "typer")


def _installed(name: str) -> bool:
    """Whether a package is there, without the cost of importing it."""
    try:
        return importlib.util.find_spec(name) is not None
    except ValueError:  # a placeholder in sys.modules
        return False


def main() -> None:
    """Run the command; without its extras, say how to get them."""
    missing = [name for name in EXTRAS if not _installed(name)]
    if missing:
        print(
            f"the deadtime command needs {', '.join(missing)}, which is not installed. Install "
            "what the command needs:\n    pip install 'deadtime[cli]'\nor also what drawing "
            "needs:\n    pip install 'deadtime[all]'",
            file=sys.stderr,
        )
        raise SystemExit(1)
    try:
        with ended_by_ctrl_c():
            from deadtime._cli.app import run
            from deadtime._cli.readable import make_readable

        make_readable()
        run()
    except KeyboardInterrupt:
        print(SAID, file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
