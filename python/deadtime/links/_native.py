"""The native functions and classes that this package uses."""

from deadtime._deadtime import (
    at_read as at_read,
    at_write as at_write,
    configuration_read as configuration_read,
    configuration_write as configuration_write,
    doubles_read as doubles_read,
    doubles_write as doubles_write,
    loop_packet_read as loop_packet_read,
    loop_packet_write as loop_packet_write,
    navdata_full as navdata_full,
    navdata_layouts as navdata_layouts,
    navdata_read as navdata_read,
    navdata_write as navdata_write,
)
