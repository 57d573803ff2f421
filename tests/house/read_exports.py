"""Files of palpate read by VTK's own readers, and a volume written by VTK's own writer.

usage: read_exports.py solution FILE.vtu FILE.csv      points and displacements are those of the CSV, to the bit
       read_exports.py series FOLDER YOUNG_PA          a series.pvd of one body: times ascend, rest shape and E stay
       read_exports.py ball FILE.mha                   writes a label volume, prints its volume in m^3
       read_exports.py points FOLDER SECONDS           prints the points of that moment of a series as JSON
       read_exports.py surfaces FOLDER                 a surfaces.pvd: times ascend, triangles of one body move
       read_exports.py surface FILE.vtp                prints points and triangles as JSON
Prints one line for each fault on stderr; exit code 1 when there is one, 77 without VTK (python3-vtk9).
"""

import csv
import json
import sys
import xml.etree.ElementTree

try:
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter
    from vtkmodules.vtkIOImage import vtkMetaImageWriter
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader
except ImportError:
    sys.exit(77)


def read(path):
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def smallest_volume(grid):
    size = vtkCellSizeFilter()
    size.SetInputData(grid)
    size.Update()
    return size.GetOutput().GetCellData().GetArray("Volume").GetRange()[0]


def solution(vtu, table):
    grid = read(vtu)
    moved = grid.GetPointData().GetArray("displacement_m")
    with open(table, newline="") as file:
        rows = [[float(word) for word in row] for row in list(csv.reader(file))[1:]]
    if grid.GetNumberOfPoints() != len(rows):
        yield f"{grid.GetNumberOfPoints()} points, {len(rows)} in the table"
        return
    for i, row in enumerate(rows):
        if [*grid.GetPoint(i), *moved.GetTuple3(i)] != row:
            yield f"point {i} is not that of the table"
    if not smallest_volume(grid) > 0:
        yield "a cell is turned inside out"
    if not grid.GetPointData().GetArray("von_mises_Pa").GetRange()[1] > 0:
        yield "there is no stress"


def series(folder, young_pa):
    rest, before = None, -1.0
    all_of_them = moments(f"{folder}/series.pvd")
    if len(all_of_them) < 2:
        yield f"{len(all_of_them)} moments"
    for time, file in all_of_them:
        grid = read(f"{folder}/{file}")
        if not time > before:
            yield f"time {time} follows {before}"
        before = time
        data = grid.GetPointData()
        moved = data.GetArray("displacement_m")
        now = [
            x - u for i in range(grid.GetNumberOfPoints()) for x, u in zip(grid.GetPoint(i), moved.GetTuple3(i))
        ]
        rest = rest or now
        # sums of doubles below 1 m
        if len(now) != len(rest) or max(abs(a - b) for a, b in zip(now, rest)) > 1e-15:
            yield f"time {time}: position less displacement is not the rest shape"
        low, high = data.GetArray("young_Pa").GetRange()
        if abs(low - young_pa) > 1e-9 * young_pa or abs(high - young_pa) > 1e-9 * young_pa:
            yield f"time {time}: E is {low} to {high} Pa, the scene has {young_pa}"
        if not smallest_volume(grid) > 0:
            yield f"time {time}: a cell is turned inside out"


def moments(path):
    """times and files of a PVD"""
    sets = xml.etree.ElementTree.parse(path).findall("./Collection/DataSet")
    return [(float(one.get("timestep")), one.get("file")) for one in sets]


def points(folder, seconds):
    for time, file in moments(f"{folder}/series.pvd"):
        if abs(time - seconds) < 1e-9:
            grid = read(f"{folder}/{file}")
            print(json.dumps({"points": [grid.GetPoint(i) for i in range(grid.GetNumberOfPoints())]}))
            return
    yield f"no moment at {seconds} s"


def read_surface(path):
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def faults_of_surface(grid):
    if any(grid.GetCell(k).GetNumberOfPoints() != 3 for k in range(grid.GetNumberOfCells())):
        yield "a cell is no triangle"
    body = grid.GetCellData().GetArray("body")
    if body.GetRange() != (1, 1):
        yield f"bodies {body.GetRange()}"
    moved = grid.GetPointData().GetArray("displacement_m")
    if not 0 < moved.GetMaxNorm() < 1:
        yield f"the largest displacement is {moved.GetMaxNorm()} m"


def surfaces(folder):
    before, rest = -1.0, None
    for time, file in moments(f"{folder}/surfaces.pvd"):
        grid = read_surface(f"{folder}/{file}")
        if not time > before:
            yield f"time {time} follows {before}"
        before = time
        yield from faults_of_surface(grid)
        moved = grid.GetPointData().GetArray("displacement_m")
        now = [
            x - u for i in range(grid.GetNumberOfPoints()) for x, u in zip(grid.GetPoint(i), moved.GetTuple3(i))
        ]
        rest = rest or now
        # differences of floats below 1 m, rounded when they were taken
        if len(now) != len(rest) or max(abs(a - b) for a, b in zip(now, rest)) > 1e-12:
            yield f"time {time}: position less displacement is not the rest shape"
    if not moved.GetMaxNorm() > 1e-4:
        yield f"it has sunk by {moved.GetMaxNorm()} m"


def surface(path):
    grid = read_surface(path)
    places = [grid.GetPoint(i) for i in range(grid.GetNumberOfPoints())]
    cells = []
    for k in range(grid.GetNumberOfCells()):
        ids = grid.GetCell(k).GetPointIds()
        cells.append([ids.GetId(c) for c in range(ids.GetNumberOfIds())])
    print(json.dumps({"points": places, "triangles": cells}))
    return faults_of_surface(grid)


def ball(path):
    size, step = (30, 24, 20), (1.0, 1.5, 2.0)
    image = vtkImageData()
    image.SetDimensions(*size)
    image.SetSpacing(*step)
    image.SetOrigin(-10, 20, 30)
    image.AllocateScalars(4, 1)  # short
    n = 0
    for k in range(size[2]):
        for j in range(size[1]):
            for i in range(size[0]):
                inside = (i - 15) ** 2 + ((j - 12) * 1.5) ** 2 + ((k - 10) * 2) ** 2 < 144
                image.SetScalarComponentFromDouble(i, j, k, 0, inside)
                n += inside
    writer = vtkMetaImageWriter()
    writer.SetInputData(image)
    writer.SetFileName(path)
    writer.SetCompression(True)
    writer.Write()
    print(n * step[0] * step[1] * step[2] * 1e-9)
    return []


kinds = {
    "solution": solution,
    "series": lambda folder, young_pa: series(folder, float(young_pa)),
    "points": lambda folder, seconds: points(folder, float(seconds)),
    "surface": surface,
    "surfaces": surfaces,
    "ball": ball,
}
faults = list(kinds[sys.argv[1]](*sys.argv[2:]))
for fault in faults[:10]:
    print(fault, file=sys.stderr)
sys.exit(1 if faults else 0)
