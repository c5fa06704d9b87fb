"""Control loops with a delay in them."""

from deadtime._special import dde_roots, lambertw

__all__ = ["dde_roots", "lambertw"]
