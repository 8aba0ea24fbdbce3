#!/usr/bin/env python3
"""Reads the files of a run with the real VTK and says what is in them.

    readback.py FILE...                 one JSON object a line for each .vtu, .vtp or .pvd
    readback.py --dump FILE ARRAY       every value of an array, one a line: integers in decimal, doubles as hex floats
    readback.py --dump FILE ARRAY --bits     doubles as the 16 hex digits of their bits

ARRAY is the name of an array, or `point:NAME`, `cell:NAME`, `field:NAME` where a name alone would not do; `Points`,
`connectivity`, `offsets` and `types` are the mesh itself.

A .pvd is followed by the objects of the files that it lists. The exit code is 1 when VTK reports an error or a
warning, an array does not have one tuple a point or cell, or a file of an index is missing; the reason is on standard
error. Needs Python 3.9 and the package `vtk`.
"""

import argparse
import json
import math
import os
import struct
import sys
import xml.etree.ElementTree as ElementTree

from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

TRIANGLE = 5
LINE = 3


class Failure(Exception):
    """A file that is not what it should be."""


def read(path):
    """The data set of a .vtu or .vtp; every message of VTK is a failure."""
    readers = {".vtu": vtkXMLUnstructuredGridReader, ".vtp": vtkXMLPolyDataReader}
    kind = os.path.splitext(path)[1]
    if kind not in readers:
        raise Failure(f"`{path}`: not .vtu, .vtp or .pvd")
    if not os.path.isfile(path):
        raise Failure(f"`{path}`: no such file")
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    messages = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(messages)
    reader = readers[kind]()
    reader.SetFileName(path)
    reader.Update()
    text = messages.GetOutput().strip()
    if text or reader.GetErrorCode():
        raise Failure(f"`{path}`: VTK reports error {reader.GetErrorCode()}: {text}")
    return reader.GetOutput()


def values(array):
    """All components of all tuples in one list, every bit kept."""
    count = array.GetNumberOfTuples() * array.GetNumberOfComponents()
    return [array.GetValue(i) for i in range(count)]


def kind(array):
    """float64, int32, uint8, ... whatever VTK calls it."""
    name = array.GetDataTypeAsString()
    bits = 8 * array.GetDataTypeSize()
    if name in ("float", "double"):
        return f"float{bits}"
    return f"uint{bits}" if name.startswith("unsigned") else f"int{bits}"


def number(value):
    """JSON has no infinity and no NaN: these are given by name."""
    return value if math.isfinite(value) else repr(value)


def summary(array):
    """What is compared: the type, the shape, and numbers in full precision."""
    data = values(array)
    total = 0
    for value in data:  # from left to right, as a plain loop does it anywhere
        total += value
    return {
        "name": array.GetName(),
        "type": kind(array),
        "tuples": array.GetNumberOfTuples(),
        "components": array.GetNumberOfComponents(),
        "min": number(min(data)) if data else None,
        "max": number(max(data)) if data else None,
        "sum": number(total),
        "first": [number(value) for value in data[:5]],
        "last": [number(value) for value in data[-5:]],
    }


def attributes(path, data, place, expected):
    """All arrays of point, cell or field data, in the order of the file."""
    result = []
    for i in range(data.GetNumberOfArrays()):
        array = data.GetArray(i)
        if array is None:
            raise Failure(f"`{path}`: array {i} of the {place} data holds no numbers")
        if expected is not None and array.GetNumberOfTuples() != expected:
            raise Failure(
                f"`{path}`: {place} array `{array.GetName()}` has {array.GetNumberOfTuples()} tuples, not {expected}"
            )
        result.append(summary(array))
    return result


def describe(path):
    """The object of one .vtu or .vtp."""
    data = read(path)
    points, cells = data.GetNumberOfPoints(), data.GetNumberOfCells()
    types = {}
    for i in range(cells):
        code = data.GetCellType(i)
        types[code] = types.get(code, 0) + 1
    only = TRIANGLE if path.endswith(".vtu") else LINE
    for code, count in types.items():
        if code != only:
            raise Failure(f"`{path}`: {count} cells of type {code}, not {only}")
    coordinates = data.GetPoints()
    return {
        "file": path,
        "points": points,
        "cells": cells,
        "cell_types": {str(code): count for code, count in types.items()},
        "coordinates": summary(coordinates.GetData()) if coordinates else None,
        "point_data": attributes(path, data.GetPointData(), "point", points),
        "cell_data": attributes(path, data.GetCellData(), "cell", cells),
        "field_data": attributes(path, data.GetFieldData(), "field", None),
    }


def series(path):
    """The object of a .pvd and the paths of its files."""
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise Failure(f"`{path}`: {error}") from error
    if root.tag != "VTKFile" or root.get("type") != "Collection":
        raise Failure(f"`{path}`: not a collection of VTK files")
    entries = [
        {"timestep": float(entry.get("timestep")), "file": entry.get("file")}
        for entry in root.iterfind("Collection/DataSet")
    ]
    steps = [entry["timestep"] for entry in entries]
    if steps != sorted(set(steps)):
        raise Failure(f"`{path}`: time steps do not ascend: {steps}")
    folder = os.path.dirname(path)
    return {"file": path, "series": entries}, [os.path.join(folder, entry["file"]) for entry in entries]


def find(path, wanted):
    """The type and the values of the array that a name means."""
    data = read(path)
    if wanted == "types":
        return "uint8", [data.GetCellType(i) for i in range(data.GetNumberOfCells())]
    if wanted in ("connectivity", "offsets"):
        cells = data.GetCells() if path.endswith(".vtu") else data.GetLines()
        array = cells.GetConnectivityArray() if wanted == "connectivity" else cells.GetOffsetsArray()
    elif wanted == "Points":
        array = data.GetPoints().GetData()
    else:
        places = {"point": data.GetPointData(), "cell": data.GetCellData(), "field": data.GetFieldData()}
        place, _, name = wanted.rpartition(":")
        searched = [places[place]] if place in places else places.values()
        found = [place.GetArray(name) for place in searched if place.HasArray(name)]
        if len(found) != 1:
            raise Failure(f"`{path}`: {len(found)} arrays of the name `{wanted}`")
        array = found[0]
    return kind(array), values(array)


def dump(path, wanted, bits):
    """Every value on its line."""
    type_name, data = find(path, wanted)
    if not type_name.startswith("float"):
        lines = map(str, data)
    elif bits:
        lines = (struct.pack(">d", value).hex() for value in data)
    else:
        lines = (value.hex() for value in data)
    sys.stdout.writelines(line + "\n" for line in lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", metavar="FILE")
    parser.add_argument("--dump", nargs=2, metavar=("FILE", "ARRAY"))
    parser.add_argument("--bits", action="store_true")
    arguments = parser.parse_args()
    if bool(arguments.files) == bool(arguments.dump):
        parser.error("either files or --dump")
    if arguments.dump:
        try:
            dump(*arguments.dump, arguments.bits)
        except Failure as failure:
            sys.exit(str(failure))
        return
    failed = False
    waiting = list(reversed(arguments.files))
    while waiting:
        path = waiting.pop()
        try:
            if path.endswith(".pvd"):
                result, files = series(path)
                waiting.extend(reversed(files))
            else:
                result = describe(path)
            print(json.dumps(result, allow_nan=False))
        except Failure as failure:
            print(failure, file=sys.stderr)
            failed = True
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
