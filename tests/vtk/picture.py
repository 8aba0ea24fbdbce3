#!/usr/bin/env python3
"""Draws one level of a run with VTK.

    picture.py LEVEL.vtu OUT.png

Left: the two membranes as surfaces, the upper one transparent, the mesh on them and the contact set. Right: the mesh
from above, the action as colour, the contact set outlined. Needs no screen: on Linux without a display the picture is
drawn through EGL, which Mesa also offers in software (packages `libegl1`, `libgl1-mesa-dri`); where that is missing,
set VTK_DEFAULT_OPENGL_WINDOW=vtkOSOpenGLRenderWindow and install OSMesa. Needs Python 3.9 and the package `vtk`.
"""

import math
import os
import sys

if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import vtkmodules.vtkRenderingFreeType  # noqa: E402,F401 (text)
import vtkmodules.vtkRenderingOpenGL2  # noqa: E402,F401 (everything else)
from vtkmodules.vtkCommonDataModel import vtkDataObject  # noqa: E402
from vtkmodules.vtkFiltersCore import (  # noqa: E402
    vtkClipPolyData,
    vtkContourFilter,
    vtkExtractEdges,
    vtkFeatureEdges,
    vtkPolyDataNormals,
)
from vtkmodules.vtkFiltersGeneral import vtkWarpScalar  # noqa: E402
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter  # noqa: E402
from vtkmodules.vtkImagingCore import vtkImageResize, vtkImageSincInterpolator  # noqa: E402
from vtkmodules.vtkIOImage import vtkPNGWriter  # noqa: E402
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader  # noqa: E402
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor  # noqa: E402
from vtkmodules.vtkRenderingCore import (  # noqa: E402
    vtkActor,
    vtkColorTransferFunction,
    vtkLightKit,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkTextActor,
    vtkWindowToImageFilter,
)

WIDTH, HEIGHT = 1600, 700
FINER = 2  # drawn this much finer, then reduced: smooth lines on every driver
HEIGHT_SHARE = 0.42  # heights are stretched to this share of the domain's width

INK = (0.13, 0.15, 0.19)
UPPER = (0.25, 0.50, 0.78)
LOWER = (0.93, 0.68, 0.32)
CONTACT = (0.74, 0.13, 0.22)
# ColorBrewer's YlOrRd from almost white, so that no action is no colour.
HEAT = ("fdfcf3", "ffeda0", "fed976", "feb24c", "fd8d3c", "fc4e2a", "e31a1c", "bd0026", "800026")


def main(source, target):
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(source)
    reader.Update()
    grid = reader.GetOutput()
    if grid.GetNumberOfCells() == 0:
        sys.exit(f"`{source}`: no triangles")
    scene = Scene(grid)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetAlphaBitPlanes(1)
    window.SetSize(FINER * WIDTH, FINER * HEIGHT)
    for renderer in (scene.membranes(), scene.plan()):
        window.AddRenderer(renderer)
    save(window, target)


class Scene:
    """What both panels draw."""

    def __init__(self, grid):
        self.grid = grid
        # Thin lines on fine meshes: the mesh should show where it is fine, not cover what is drawn on it.
        self.faint = min(1.0, (4000 / grid.GetNumberOfCells()) ** 0.5)

    def membranes(self):
        """The left panel."""
        renderer = panel(0.0, 0.53)
        low = min(self.range("u1")[0], self.range("u2")[0])
        high = max(self.range("u1")[1], self.range("u2")[1])
        x0, x1, y0, y1, _, _ = self.grid.GetBounds()
        stretch = HEIGHT_SHARE * max(x1 - x0, y1 - y0) / (high - low) if high > low else 1.0
        drawn = []
        for name, colour, opacity in (("u2", LOWER, 1.0), ("u1", UPPER, 0.52)):
            surface = self.warped(self.grid, name, stretch)
            drawn.append(surface)
            renderer.AddActor(faces(surface, colour, opacity))
            renderer.AddActor(lines(edges(surface), shade(colour), 0.7, (0.75 if name == "u2" else 0.6) * self.faint))
            renderer.AddActor(lines(outline(surface), shade(colour), 2.0))
        patch = in_contact(surface)
        if patch.GetNumberOfCells() > 0:
            actor = faces(patch, CONTACT, 1.0)
            # In front of both membranes, which it coincides with.
            actor.GetMapper().SetRelativeCoincidentTopologyPolygonOffsetParameters(-2.0, -2.0)
            renderer.AddActor(actor)
            mesh = lines(in_contact(edges(surface)), (1, 1, 1), 0.7, 0.45 * self.faint)
            mesh.GetMapper().SetRelativeCoincidentTopologyLineOffsetParameters(-8.0, -8.0)
            renderer.AddActor(mesh)
        renderer.SetUseDepthPeeling(1)
        renderer.SetMaximumNumberOfPeels(8)
        renderer.SetOcclusionRatio(0.0)
        lights = vtkLightKit()
        lights.SetKeyLightIntensity(0.85)
        lights.SetKeyLightElevation(55)
        lights.SetKeyToFillRatio(2.2)
        lights.AddLightsToRenderer(renderer)
        camera = renderer.GetActiveCamera()
        camera.SetPosition(-0.55, -1.35, 0.62)
        camera.SetFocalPoint(0, 0, 0)
        camera.SetViewUp(0, 0, 1)
        camera.SetViewAngle(20)
        fit(renderer, drawn, (-0.93, 0.93), (-0.84, 0.66))
        title(renderer, "Two membranes in contact")
        note = f"heights \u00d7 {stretch:.3g}" if high > low else "flat"
        caption(renderer, f"{self.grid.GetNumberOfPoints():,} vertices, {note}", 0.04, 0.035)
        place = 0.04
        for text, colour, width in (("upper u1", UPPER, 0.16), ("lower u2", LOWER, 0.16), ("contact set", CONTACT, 0)):
            swatch = text_at(renderer, "     ", place, 0.866, 14, INK).GetTextProperty()
            swatch.SetBackgroundColor(*colour)
            swatch.SetBackgroundOpacity(1)
            text_at(renderer, text, place + 0.035, 0.862, 17, INK)
            place += width
        return renderer

    def plan(self):
        """The right panel."""
        renderer = panel(0.53, 1.0)
        surface = polygons(self.grid)
        top, largest = self.largest_action()
        colours = heat(top)
        actor = faces(surface, (1, 1, 1), 1.0)
        actor.GetProperty().LightingOff()
        mapper = actor.GetMapper()
        mapper.ScalarVisibilityOn()
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray("action")
        mapper.SetLookupTable(colours)
        mapper.UseLookupTableScalarRangeOn()
        mapper.InterpolateScalarsBeforeMappingOn()
        renderer.AddActor(actor)
        for drawn, colour, width, opacity in (
            (edges(surface), INK, 0.7, 0.38 * self.faint),
            (outline(surface), INK, 1.6, 1.0),
            (self.contact_outline(), (0.05, 0.2, 0.55), 3.0, 1.0),
        ):
            renderer.AddActor(lines(drawn, colour, width, opacity))
        camera = renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        camera.SetPosition(0, 0, 1)
        camera.SetFocalPoint(0, 0, 0)
        fit(renderer, [surface], (-0.93, 0.66), (-0.83, 0.78))
        title(renderer, "Action and contact set")
        if largest > 0:
            renderer.AddViewProp(colour_bar(colours))
            text_at(renderer, "action", 0.875, 0.805, 17, INK)
        level = self.field("level")
        bound = self.field("error_bound")
        facts = [f"action up to {largest:.3g}" if largest > 0 else "no contact"]
        if level is not None:
            facts.append(f"level {level:g}")
        if bound is not None:
            facts.append(f"error bound {bound:.3g}")
        caption(renderer, ", ".join(facts), 0.04, 0.035)
        return renderer

    def range(self, name):
        """Least and largest value of a point array."""
        array = self.grid.GetPointData().GetArray(name)
        if array is None:
            sys.exit(f"no point array `{name}`")
        return array.GetRange()

    def largest_action(self):
        """The action exceeded on less than a hundredth of the contact set, and the largest anywhere.

        Colours end at the first: a single vertex at the edge of the contact set must not wash out the rest.
        """
        data = self.grid.GetPointData()
        action, force = data.GetArray("action"), data.GetArray("action_force")
        pairs = ((action.GetValue(i), force.GetValue(i)) for i in range(self.grid.GetNumberOfPoints()))
        # Force over action is the area of the dual cell.
        cells = sorted(((a, f / a) for a, f in pairs if a > 0), reverse=True)
        if not cells:
            return 0.0, 0.0
        largest, left = cells[0][0], 0.01 * sum(area for _, area in cells)
        for value, area in cells:
            left -= area
            if left < 0:
                break
        return (largest if value > 0.8 * largest else value), largest

    def field(self, name):
        """A number that belongs to the whole file, or None."""
        array = self.grid.GetFieldData().GetArray(name)
        return array.GetTuple1(0) if array is not None else None

    def warped(self, grid, name, stretch):
        """The grid lifted to the heights of a point array, with normals."""
        warp = vtkWarpScalar()
        warp.SetInputData(grid)
        warp.SetInputArrayToProcess(0, 0, 0, vtkDataObject.FIELD_ASSOCIATION_POINTS, name)
        warp.SetNormal(0, 0, 1)
        warp.UseNormalOn()
        warp.SetScaleFactor(stretch)
        warp.Update()
        normals = vtkPolyDataNormals()
        normals.SetInputData(polygons(warp.GetOutput()))
        normals.SplittingOff()
        normals.ConsistencyOff()
        normals.Update()
        return normals.GetOutput()

    def contact_outline(self):
        """The line half way between vertices in contact and others."""
        contour = vtkContourFilter()
        contour.SetInputData(polygons(self.grid))
        contour.SetInputArrayToProcess(0, 0, 0, vtkDataObject.FIELD_ASSOCIATION_POINTS, "contact")
        contour.SetValue(0, 0.5)
        contour.Update()
        return contour.GetOutput()


def in_contact(data):
    """The part of surfaces or lines inside the outline of the contact set."""
    data.GetPointData().SetActiveScalars("contact")  # the filter takes no name
    clip = vtkClipPolyData()
    clip.SetInputData(data)
    clip.SetValue(0.5)
    clip.Update()
    return clip.GetOutput()


def panel(left, right):
    renderer = vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.SetViewport(left, 0, right, 1)
    return renderer


def fit(renderer, drawn, across, up):
    """Turns the camera's angle and centre so that what is drawn fills a box, given from -1 to 1 in the panel."""
    camera = renderer.GetActiveCamera()
    renderer.ResetCamera()
    width, height = WIDTH * (renderer.GetViewport()[2] - renderer.GetViewport()[0]), HEIGHT
    matrix = camera.GetCompositeProjectionTransformMatrix(width / height, -1, 1)
    xs, ys = [], []
    for surface in drawn:
        for i in range(surface.GetNumberOfPoints()):
            x, y, _, w = matrix.MultiplyPoint((*surface.GetPoint(i), 1))
            xs.append(x / w)
            ys.append(y / w)
    zoom = min((across[1] - across[0]) / (max(xs) - min(xs)), (up[1] - up[0]) / (max(ys) - min(ys)))
    if camera.GetParallelProjection():
        camera.SetParallelScale(camera.GetParallelScale() / zoom)
    else:
        half = math.radians(camera.GetViewAngle() / 2)
        camera.SetViewAngle(2 * math.degrees(math.atan(math.tan(half) / zoom)))
    camera.SetWindowCenter(
        (zoom * (min(xs) + max(xs)) - sum(across)) / 2, (zoom * (min(ys) + max(ys)) - sum(up)) / 2
    )


def polygons(grid):
    """The triangles as polygonal data."""
    geometry = vtkGeometryFilter()
    geometry.SetInputData(grid)
    geometry.Update()
    return geometry.GetOutput()


def edges(surface):
    """Every edge of the mesh."""
    extract = vtkExtractEdges()
    extract.SetInputData(surface)
    extract.Update()
    return extract.GetOutput()


def outline(surface):
    """The edges with one triangle."""
    features = vtkFeatureEdges()
    features.SetInputData(surface)
    features.BoundaryEdgesOn()
    features.FeatureEdgesOff()
    features.NonManifoldEdgesOff()
    features.ManifoldEdgesOff()
    features.ColoringOff()
    features.Update()
    return features.GetOutput()


def faces(surface, colour, opacity):
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(surface)
    mapper.ScalarVisibilityOff()
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(1.0, 1.0)
    actor = vtkActor()
    actor.SetMapper(mapper)
    properties = actor.GetProperty()
    properties.SetColor(*colour)
    properties.SetOpacity(opacity)
    properties.SetAmbient(0.22)
    properties.SetDiffuse(0.78)
    properties.SetSpecular(0.12)
    properties.SetSpecularPower(30)
    return actor


def lines(data, colour, width, opacity=1.0):
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.ScalarVisibilityOff()
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-3.0, -3.0)
    actor = vtkActor()
    actor.SetMapper(mapper)
    properties = actor.GetProperty()
    properties.SetColor(*colour)
    properties.SetLineWidth(FINER * width)
    properties.SetOpacity(opacity)
    properties.LightingOff()
    return actor


def shade(colour):
    """The colour of the lines on a surface of this colour."""
    return tuple(0.42 * c for c in colour)


def heat(top):
    """Colours from no action to the largest."""
    colours = vtkColorTransferFunction()
    colours.SetColorSpaceToLab()
    for i, code in enumerate(HEAT):
        rgb = (int(code[k : k + 2], 16) / 255 for k in (0, 2, 4))
        colours.AddRGBPoint((top if top > 0 else 1.0) * i / (len(HEAT) - 1), *rgb)
    return colours


def colour_bar(colours):
    bar = vtkScalarBarActor()
    bar.SetLookupTable(colours)
    bar.SetTitle("")
    bar.SetNumberOfLabels(5)
    bar.SetLabelFormat("%.3g")
    bar.UnconstrainedFontSizeOn()
    bar.SetPosition(0.875, 0.16)
    bar.SetWidth(0.085)
    bar.SetHeight(0.62)
    bar.SetBarRatio(0.28)
    style(bar.GetLabelTextProperty(), 15, INK)
    return bar


def title(renderer, text):
    actor = text_at(renderer, text, 0.04, 0.915, 25, INK)
    actor.GetTextProperty().BoldOn()


def caption(renderer, text, x, y):
    text_at(renderer, text, x, y, 16, (0.38, 0.41, 0.46))


def text_at(renderer, text, x, y, size, colour):
    actor = vtkTextActor()
    actor.SetInput(text)
    actor.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    actor.SetPosition(x, y)
    style(actor.GetTextProperty(), size, colour)
    renderer.AddViewProp(actor)
    return actor


def style(properties, size, colour):
    properties.SetFontFamilyToArial()
    properties.SetFontSize(FINER * size)
    properties.SetColor(*colour)
    properties.ItalicOff()
    properties.BoldOff()
    properties.ShadowOff()


def save(window, target):
    """Draws, reduces to the final size and writes."""
    window.Render()
    image = vtkWindowToImageFilter()
    image.SetInput(window)
    image.SetInputBufferTypeToRGB()
    image.ReadFrontBufferOff()
    interpolator = vtkImageSincInterpolator()
    interpolator.AntialiasingOn()
    smaller = vtkImageResize()
    smaller.SetInputConnection(image.GetOutputPort())
    smaller.SetOutputDimensions(WIDTH, HEIGHT, 1)
    smaller.SetInterpolator(interpolator)
    smaller.InterpolateOn()
    writer = vtkPNGWriter()
    writer.SetFileName(target)
    writer.SetInputConnection(smaller.GetOutputPort())
    writer.Write()


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
