"""The columns of a table that is read, as options. Readers are slow to load: a file of its own."""

from deadtime._cli import options as opt
from deadtime._cli.fills import Fills
from deadtime.recordings import read_recording

COLUMNS = Fills(
    read_recording,
    "time reference output command",
    time=opt.Time,
    reference=opt.Reference,
    output=opt.Output,
    command=opt.Command,
)
