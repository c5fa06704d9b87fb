"""The ``deadtime`` command."""

from __future__ import annotations

import sys

__all__ = ["main"]


def main() -> None:
    """Run the command; without its extras, say how to get them."""
    try:
        import matplotlib  # noqa: F401
        import rich  # noqa: F401
        import typer  # noqa: F401
    except ImportError as error:
        print(
            f"the deadtime command needs {error.name}, which is not installed; this line installs "
            "everything it needs:\n    pip install 'deadtime[all]'",
            file=sys.stderr,
        )
        raise SystemExit(1) from None
    from deadtime._cli.app import run

    run()
