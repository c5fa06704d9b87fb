"""MAT files of versions 5 and 7.3: vectors, matrices, and structures as Simulink writes them."""

import deadtime as dtm
import numpy as np
import pytest
from flights import flight_path
from scipy.io import savemat
from step_table import COLUMNS, NAMES, assert_is_the_table

T, R, Y, U = COLUMNS.values()

#: A structure with time, as the block "To Workspace" of Simulink writes it.
SIMULINK = {
    "time": T[:, None],
    "signals": {"values": np.stack([R, Y, U], axis=1), "dimensions": 3.0, "label": "z"},
    "blockName": "loop/To Workspace",
}
#: The same from a scope with two axes.
SCOPE = {
    "time": T[:, None],
    "signals": [{"values": R[:, None], "label": "r"}, {"values": Y[:, None], "label": "y"}],
}
VARIABLES = COLUMNS | {
    "rows": np.stack([R, Y, U], axis=1),
    "columns": np.stack([T, R, Y, U]),
    "log": SIMULINK,
    "scope": SCOPE,
    "name": "hover",
    "gain": 1.6,
}


def save5(stream, packed):
    signals = np.empty((1, 2), dtype=[("values", "O"), ("label", "O")])
    for k, one in enumerate(SCOPE["signals"]):
        signals[0, k] = (one["values"], one["label"])
    scope = {"time": SCOPE["time"], "signals": signals}
    savemat(stream, VARIABLES | {"scope": scope}, do_compression=packed)


def save73(path):
    """Write what MATLAB writes: reversed axes, structures as groups, arrays of them as references.

    The file begins with 512 bytes of MATLAB's own.
    """
    h5py = pytest.importorskip("h5py", reason="h5py reads MAT files of version 7.3")
    with h5py.File(path, "w", userblock_size=512) as file:

        def put(place, name, value):
            if isinstance(value, dict):
                group = place.create_group(name)
                group.attrs["MATLAB_class"] = np.bytes_("struct")
                for field, part in value.items():
                    put(group, field, part)
            elif isinstance(value, list):
                group = place.create_group(name)
                group.attrs["MATLAB_class"] = np.bytes_("struct")
                for field in value[0]:
                    references = []
                    for one in value:
                        where = f"#refs#/{len(file.require_group('#refs#'))}"
                        put(file, where, one[field])
                        references.append([file[where].ref])
                    group.create_dataset(field, data=references, dtype=h5py.ref_dtype)
            else:
                text = isinstance(value, str)
                array = np.atleast_2d(
                    np.frombuffer(value.encode("utf-16-le"), np.uint16) if text else value
                )
                place[name] = array.T
                kind = np.bytes_("char" if text else "double")
                place[name].attrs["MATLAB_class"] = kind

        for name, value in VARIABLES.items():
            put(file, name, value)
    with open(path, "r+b") as file:
        head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 ."
        file.write(head.ljust(124) + b"\x00\x02IM")


@pytest.fixture(params=["v5", "v5, packed", "v7.3"])
def path(request, tmp_path):
    path = tmp_path / "flight.csv"
    if request.param == "v7.3":
        save73(path)
    else:
        with path.open("wb") as stream:
            save5(stream, packed="packed" in request.param)
    return path


@pytest.mark.parametrize(
    "addresses",
    [
        ("t_s", "ref_m", "height_m", "speed"),
        ("t_s", "rows[0]", "rows[1]", "rows[2]"),
        ("columns[0]", "columns[1]", "columns[2]", "columns[3]"),
        ("log.time", "log.signals.values[0]", "log.signals.values[1]", "log.signals.values[2]"),
        ("scope.time", "scope.signals[0].values", "scope.signals[1].values", "speed"),
    ],
)
def test_an_address_leads_to_its_column(path, addresses):
    time, reference, output, command = addresses
    assert_is_the_table(
        dtm.read_recording(path, time=time, reference=reference, output=output, command=command)
    )


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("rows", r"no column 'rows' for the output. Its columns are .*; did you mean 'rows\["),
        ("rows[3]", r"did you mean 'rows\[2\]'"),
        ("log.signals.value[1]", r"did you mean 'log.signals.values\[1\]'"),
        ("name", "no column 'name'"),
        ("gain", "no column 'gain'"),
        ("nothing", "no column 'nothing'"),
    ],
)
def test_an_address_without_a_column_is_refused(path, address, words):
    with pytest.raises(dtm.RecordingError, match=words):
        dtm.read_recording(path, **(NAMES | {"output": address}))


def test_a_file_that_is_cut_off_is_refused(path):
    path.write_bytes(path.read_bytes()[:400])
    with pytest.raises(dtm.RecordingError, match="may be damaged or cut off"):
        dtm.read_recording(path, **NAMES)


def test_a_scalar_signal_of_simulink_in_three_dimensions_is_a_column(tmp_path):
    path = tmp_path / "flight.mat"
    savemat(path, {"t": T, "r": R.reshape(1, 1, -1), "y": Y})
    assert_is_the_table(dtm.read_recording(path, time="t", reference="r", output="y"))


def test_heights_of_a_real_flight_are_those_of_the_table_beside_them():
    path = flight_path("ardrone2_height_step_2_4_0_25.mat")
    beside = dtm.read_recording(
        flight_path("ardrone2_height_step_2_4_0_25.csv"),
        time="t_s", reference="ref_m", output="height_m",
    )  # fmt: skip
    flight = dtm.read_recording(
        path,
        time="states.time",
        reference="states.signals.values[6]",
        output="states.signals.values[8]",
    )
    np.testing.assert_allclose(flight.time, beside.time, atol=5e-4)
    np.testing.assert_allclose(flight.output, beside.output, atol=5e-5)


def test_matrices_of_a_real_flight_are_read():
    flight = dtm.read_recording(
        flight_path("tailsitter_step_size1_1.mat"),
        reference="actuator_controls[1]",
        output="local_rate[1]",
        window=(10.0, 60.0),
    )
    assert len(flight) == 5001
    assert flight.sample_time == pytest.approx(0.01)
