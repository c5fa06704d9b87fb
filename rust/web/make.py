"""Build the kernels for a page, and put them where the package reads them.

``python rust/web/make.py`` builds; ``--check`` says whether the module in the tree was made from
the sources in the tree. Building needs ``rustup target add wasm32-unknown-unknown`` and
``pip install zopfli``, whose gzip is a twentieth smaller than that of zlib.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLACE = ROOT / "python/deadtime/_base/explorer"
MODULE, ORIGIN = PLACE / "kernels.wasm.gz", PLACE / "kernels.json"

#: What the module is made from.
SOURCES = ("rust/core/src", "rust/web/src")
FILES = ("Cargo.toml", "Cargo.lock", "rust/core/Cargo.toml", "rust/web/Cargo.toml")

#: Largest size of the compressed module, in bytes. The page fits and judges a recording as the
#: package does, which takes a fifth of it, and designs gains, a thirteenth. More: a page takes
#: longer to load.
MOST = 520_000


def sources_hash() -> str:
    """SHA-256 over names and contents of all sources, tests left out."""
    paths = [ROOT / name for name in FILES]
    for folder in SOURCES:
        paths += [path for path in (ROOT / folder).rglob("*.rs") if path.name != "tests.rs"]
    digest = hashlib.sha256()
    for path in sorted(paths):
        digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0")
        digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()


def build() -> bytes:
    """Compile the module, without the names of folders of this machine."""
    home = Path(os.environ.get("CARGO_HOME", Path.home() / ".cargo"))
    flags = [f"--remap-path-prefix={ROOT}=."]
    flags += [f"--remap-path-prefix={one}=crates" for one in (home / "registry/src").glob("*")]
    environment = os.environ | {"CARGO_ENCODED_RUSTFLAGS": "\x1f".join(flags)}
    command = "cargo build --locked --profile web -p deadtime-web --target wasm32-unknown-unknown"
    subprocess.run(command.split(), cwd=ROOT, env=environment, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return (target / "wasm32-unknown-unknown/web/deadtime_web.wasm").read_bytes()


def main() -> int:
    """Build or check, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="build nothing")
    found = sources_hash()
    if parser.parse_args().check:
        made_from = json.loads(ORIGIN.read_text(encoding="utf-8"))["sources"]
        if made_from != found:
            print("the module of the explorer is older than its sources: python rust/web/make.py")
            return 1
        print("the module of the explorer was made from these sources")
        return 0
    try:
        from zopfli import gzip
    except ImportError:
        print("pip install zopfli")
        return 1
    module = build()
    packed = gzip.compress(module)
    if len(packed) > MOST:
        print(f"{len(packed)} bytes compressed, more than {MOST}: leave something out")
        return 1
    MODULE.write_bytes(packed)
    about = {"sources": found, "bytes": len(module), "compressed": len(packed)}
    ORIGIN.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    print(f"{MODULE.name}: {len(module)} bytes, {len(packed)} compressed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
