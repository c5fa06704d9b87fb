"""The options of navdata with known fields, in SI units, with the signs and names of the drone.

Their classes are made from the native table, which says where in the bytes the fields are. The stub
beside this file has their types.
"""

from __future__ import annotations

from dataclasses import make_dataclass
from typing import Any

from deadtime.links._native import navdata_layouts

_LAYOUTS = {layout.name: layout for layout in navdata_layouts()}


def _option(name: str) -> Any:
    """The class of an option: its tag, and its fields, zero where they are not given."""
    layout = _LAYOUTS[name.removesuffix("Option")]
    fields = [(field, type(zero), zero) for field, _, zero in layout.fields]
    described = [f"{field} : {type(zero).__name__}\n   {doc}" for field, doc, zero in layout.fields]
    doc = "\n".join([layout.doc.strip(), "", "Attributes", "----------", *described])
    names = {"tag": layout.tag, "__doc__": doc, "__module__": __name__}
    return make_dataclass(name, fields, namespace=names, frozen=True)


Demo = _option("Demo")
RawMeasures = _option("RawMeasures")
PhysicalMeasures = _option("PhysicalMeasures")
References = _option("References")
RcReferences = _option("RcReferences")
Pwm = _option("Pwm")
AltitudeOption = _option("AltitudeOption")
VideoStream = _option("VideoStream")
Pressure = _option("Pressure")
KalmanPressure = _option("KalmanPressure")
Wifi = _option("Wifi")
