"""``python -m deadtime`` is the ``deadtime`` command."""

from deadtime._cli import main

if __name__ == "__main__":
    main()
