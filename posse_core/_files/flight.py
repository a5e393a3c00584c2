"""Reading and writing the record of a flight, ``flight.npz``."""

from __future__ import annotations

import zipfile
from dataclasses import fields
from pathlib import Path

import numpy as np

from posse_core._errors import InputError
from posse_core._files.atomic import atomic_file
from posse_core._model.flight_record import FlightRecord


def save_flight(record: FlightRecord, path: Path) -> None:
    """Write a record; its bytes depend on its arrays alone."""
    with atomic_file(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, array in record.arrays().items():
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            with archive.open(entry, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asarray(array, order="C"), allow_pickle=False)


def load_flight(path: Path) -> FlightRecord:
    """Read the record of a flight.

    Raises:
        InputError: the file is missing or is not the record of a flight.
    """
    names = [part.name for part in fields(FlightRecord)]
    try:
        with np.load(path, allow_pickle=False) as archive:
            return FlightRecord(**{name: archive[name] for name in names})
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; 'posse fly' writes it") from None
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not the record of a flight: {' '.join(str(error).split())}") from None
