"""Draws docs/picture/liver.png: the liver of the README at rest and at its largest pull.

The picture is remade, from the root of the repository, by

    cargo run --release -p yawara -- run liver --set output.frames_every=1 --set output.void=true --out runs/picture
    cargo run --release -p yawara -- mesh phantom --base-mm 16 --level 9 --out runs/voxels.vtu
    python docs/picture/render.py runs/picture runs/voxels.vtu docs/picture/liver.png

The second command writes the labels that the organ is meshed from, six tetrahedra a voxel, of a
liver of 200 mm; they are scaled to the scene's length.
Needs Python 3.11 and, from PyPI, pyvista 0.49 (it brings vtk, numpy and matplotlib) and Pillow
10.1 or later: `pip install pyvista pillow`. No display: VTK draws off-screen through EGL
(Debian: libegl1, libgl1-mesa-dri).

What is drawn: the organ, opened along a plane of the mesh at rest. The blurred indicator of each
tissue is contoured on the voxels, and each point moves with the tetrahedron of the simulated mesh
that it lies in. The dark lines are where the faces of those tetrahedra meet the plane and the
organ's surface. The colours are the von Mises stress, averaged over the tetrahedra around a
vertex, void left out. The grey shape is the opened body at rest, the arrow the tool's path. Only
the largest piece of each tissue inside is shown, slightly smoothed: branches thinner than a voxel
break into specks. The counts are of the whole mesh, void in its outermost cells included.
Millimetres, scanner RAS.
"""

import argparse
import tomllib
import xml.etree.ElementTree
from pathlib import Path

import numpy as np
import pyvista as pv
from matplotlib.colors import LinearSegmentedColormap
from PIL import Image, ImageDraw, ImageFont

WIDTH, HEIGHT, FINER = 1400, 700, 2
PARENCHYMA, VESSELS, GALLBLADDER, TUMOUR = 1, 2, 3, 4
COLOURS = {VESSELS: "#3567b5", GALLBLADDER: "#5d9e58", TUMOUR: "#f0c02f"}
STRESS_COLOURS = ["#f4dfd3", "#f3b886", "#e5703f", "#b3223c", "#561045"]
STRESS_RANGE_PA = (1e2, 1e4)
# Thin branches vanish at one half.
ISOVALUES = {PARENCHYMA: 0.5, VESSELS: 0.35, GALLBLADDER: 0.5, TUMOUR: 0.5}
BLUR_VOXELS = {PARENCHYMA: 1.2, VESSELS: 0.8, GALLBLADDER: 1.0, TUMOUR: 1.2}
SMOOTHINGS = {VESSELS: 12, GALLBLADDER: 60, TUMOUR: 60}
PADDING_VOXELS = 6
# `yawara mesh phantom` draws the liver of this length, whatever the scene asks for.
PHANTOM_LENGTH_MM = 200.0
FACE_DIVISIONS = 16
# The organ is opened along x + y = 0, where base cells meet in whole faces; a hair to the side,
# so that rounding does not decide on which side a face lies.
CUT_NORMAL, CUT_ORIGIN = np.array([1, 1, 0]) / np.sqrt(2), np.array([-1e-3, 0, 0])
# Seen from the front, the patient's right and above, without perspective.
TOWARD = np.array([0.55, 0.75, 0.37]) / np.linalg.norm([0.55, 0.75, 0.37])
FOCUS, HALF_HEIGHT_MM = np.array([-13.5, 11.0, -4.0]), 108.0
INK, FAINT = "#2b2b2b", "#6d6d6d"


def frames(run):
    """The frames of a run directory, (time in s, grid)."""
    for entry in xml.etree.ElementTree.parse(run / "frames.pvd").iter("DataSet"):
        yield float(entry.get("timestep")), pv.read(run / entry.get("file"))


def largest_pull(run):
    """The first frame and the one of the largest pull; of equal pulls the most refined."""
    pulled = [(round(np.abs(grid["displacement_mm"]).max(), 1), grid.n_points, time, grid)
              for time, grid in frames(run)]
    best = max(pulled, key=lambda entry: entry[:3])
    return next(frames(run)), best[2:]


def at_rest(grid):
    """The grid moved back to rest; its displacement stays with it."""
    rest = grid.copy()
    rest.points = grid.points - grid["displacement_mm"]
    return rest


def voxels(path, length_mm):
    """The labels of a one-voxel mesh as an image, scaled to the scene's length."""
    mesh = pv.read(path)
    low = np.array(mesh.bounds[::2])
    corners = mesh.points[mesh.cells.reshape(-1, 5)[:, 1:]]
    spacing = np.abs(corners[0] - corners[0, 0]).max()
    index = np.floor((corners.mean(1) - low) / spacing).astype(int) + PADDING_VOXELS
    labels = np.zeros(index.max(0) + 1 + PADDING_VOXELS, int)
    labels[tuple(index.T)] = mesh["label"]
    scale = length_mm / PHANTOM_LENGTH_MM
    origin = (low + (0.5 - PADDING_VOXELS) * spacing) * scale
    image = pv.ImageData(dimensions=labels.shape, spacing=[spacing * scale] * 3, origin=origin)
    return image, labels


def indicator(image, inside, blur):
    """The blurred indicator of a set of voxels."""
    field = image.copy()
    field["inside"] = inside.astype(float).ravel(order="F")
    return field.gaussian_smooth(std_dev=blur, radius_factor=4.0, scalars="inside")


def values(field, points):
    """Trilinear interpolation of an indicator; 0 outside the image."""
    array = field["inside"].reshape(field.dimensions, order="F")
    place = (points - np.array(field.origin)) / np.array(field.spacing)
    place = np.clip(place, 0, np.array(array.shape) - 1.001)
    cell = place.astype(int)
    part = place - cell
    total = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, part, 1 - part), axis=1)
        total += weight * array[tuple((cell + corner).T)]
    return total


def divided_triangle(n):
    """A triangle in n² small ones: barycentric coordinates of the points, corners of the small."""
    places = [(i, j) for i in range(n + 1) for j in range(n + 1 - i)]
    number = {place: k for k, place in enumerate(places)}
    weights = np.array([(i, j, n - i - j) for i, j in places]) / n
    small = [(number[i, j], number[i + 1, j], number[i, j + 1])
             for i in range(n) for j in range(n - i)]
    small += [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1])
              for i in range(n) for j in range(n - i - 1)]
    return weights, np.array(small)


def divided_faces(grid):
    """The faces of all tetrahedra, once each, in small triangles that carry the displacement."""
    tets = grid.cells.reshape(-1, 5)[:, 1:]
    sides = [tets[:, corners] for corners in ([1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2])]
    faces = np.unique(np.sort(np.concatenate(sides), axis=1), axis=0)
    weights, small = divided_triangle(FACE_DIVISIONS)
    first = np.arange(len(faces))[:, None, None] * len(weights)
    triangles = (first + small).reshape(-1, 3)
    points = np.einsum("wc,fcx->fwx", weights, grid.points[faces]).reshape(-1, 3)
    result = pv.PolyData.from_regular_faces(points, triangles)
    moves = grid["displacement_mm"][faces]
    result["displacement_mm"] = np.einsum("wc,fcx->fwx", weights, moves).reshape(-1, 3)
    return result


def traces(faces, distance, keep):
    """The lines in which the faces meet the surface of zero distance, where `keep` ≥ 0."""
    cut = faces.copy(deep=False)
    cut["distance"], cut["keep"] = distance, keep
    lines = cut.contour([0.0], scalars="distance")
    return lines.clip_scalar(scalars="keep", value=0.0, invert=False) if lines.n_points else lines


def vertex_stress(rest):
    """The mean von Mises stress of the tetrahedra around each vertex, void left out, Pa."""
    solid = rest["label"] != 0
    tets = rest.cells.reshape(-1, 5)[solid, 1:]
    stress = np.repeat(rest["von_mises_pa"][solid], 4)
    total = np.bincount(tets.ravel(), stress, rest.n_points)
    return total / np.maximum(np.bincount(tets.ravel(), minlength=rest.n_points), 1)


def carried(surface, rest):
    """The surface with the displacement and the stress of the tetrahedron around each point."""
    cell = np.asarray(rest.find_containing_cell(surface.points))
    # The blur may push the surface out of the mesh by a fraction of a voxel.
    outside = cell < 0
    if outside.any():
        cell[outside] = rest.find_closest_cell(surface.points[outside])
    corners = rest.cells.reshape(-1, 5)[cell, 1:]
    first = rest.points[corners[:, 0]]
    edges = (rest.points[corners[:, 1:]] - first[:, None]).transpose(0, 2, 1)
    parts = np.linalg.solve(edges, (surface.points - first)[:, :, None])[:, :, 0]
    weights = np.column_stack([1 - parts.sum(1), parts])
    result = surface.copy()
    result["displacement_mm"] = np.einsum("pc,pcx->px", weights, rest["displacement_mm"][corners])
    result["stress"] = np.einsum("pc,pc->p", weights, vertex_stress(rest)[corners])
    return result


def moved(mesh):
    """The mesh at its displaced points."""
    result = mesh.copy()
    result.points = mesh.points + mesh["displacement_mm"]
    return result


class Organ:
    """The tissues at rest: indicators, surfaces, the opened body and its cut."""

    def __init__(self, image, labels):
        solid = (labels > 0) & (labels != GALLBLADDER)
        self.body = indicator(image, solid, BLUR_VOXELS[PARENCHYMA])
        whole = self.body.contour([ISOVALUES[PARENCHYMA]], scalars="inside")
        self.shell = whole.clip(CUT_NORMAL, origin=CUT_ORIGIN).triangulate()
        plane = self.body.slice(CUT_NORMAL, origin=CUT_ORIGIN)
        inside = plane.clip_scalar(scalars="inside", value=ISOVALUES[PARENCHYMA], invert=False)
        self.cut = inside.triangulate()
        self.rim = plane.contour([ISOVALUES[PARENCHYMA]], scalars="inside")
        self.tissues = {}
        for label in COLOURS:
            field = indicator(image, labels == label, BLUR_VOXELS[label])
            surface = field.contour([ISOVALUES[label]], scalars="inside")
            largest = surface.connectivity("largest").extract_surface(algorithm=None)
            self.tissues[label] = largest.smooth_taubin(n_iter=SMOOTHINGS[label], pass_band=0.06)

    def lines(self, rest):
        """Where the faces of the mesh meet the shell and the cut."""
        faces = divided_faces(rest)
        depth = values(self.body, faces.points) - ISOVALUES[PARENCHYMA]
        behind = (CUT_ORIGIN - faces.points) @ CUT_NORMAL
        return traces(faces, depth, behind), traces(faces, behind, depth)


def arrow(rest, tool_mm):
    """The tool's path, from the middle of what has moved by nearly as much."""
    off = np.linalg.norm(rest["displacement_mm"] - tool_mm, axis=1)
    start = rest.points[off <= 0.1 * np.linalg.norm(tool_mm)].mean(0)
    return pv.Arrow(start=start, direction=tool_mm, scale="auto", tip_length=0.28, tip_radius=0.08,
                    shaft_radius=0.018, shaft_resolution=40, tip_resolution=40)


def panel(plotter, organ, grid, tool_mm):
    """Draws the organ as moved by one frame; with the tool's path if it moved."""
    rest = at_rest(grid)
    ramp = LinearSegmentedColormap.from_list("stress", STRESS_COLOURS)
    stress = dict(scalars="stress", cmap=ramp, clim=STRESS_RANGE_PA, log_scale=True,
                  show_scalar_bar=False)
    shell, cut = moved(carried(organ.shell, rest)), moved(carried(organ.cut, rest))
    for mesh in (shell, cut):
        mesh["stress"] = np.maximum(mesh["stress"], STRESS_RANGE_PA[0])
    plotter.add_mesh(shell, smooth_shading=True, ambient=0.35, diffuse=0.7, specular=0.1, **stress)
    # The cut is a diagram: its colours are to be read, not shaded.
    plotter.add_mesh(cut, lighting=False, **stress)
    for lines, colour in zip(organ.lines(rest), ("#6b4a44", "#3a2a2a")):
        plotter.add_mesh(moved(lines).translate(0.6 * TOWARD), color=colour,
                         line_width=1.1 * FINER, lighting=False)
    for label, surface in organ.tissues.items():
        plotter.add_mesh(moved(carried(surface, rest)), color=COLOURS[label], smooth_shading=True,
                         ambient=0.35, diffuse=0.75, specular=0.25, specular_power=25)
    rim = moved(carried(organ.rim, rest)).translate(0.7 * TOWARD)
    plotter.add_mesh(rim, color=INK, line_width=2.0 * FINER, lighting=False)
    if np.any(tool_mm):
        above = arrow(rest, tool_mm).translate(300 * TOWARD)
        plotter.add_mesh(above, color=INK, lighting=False)
        for mesh in (organ.shell, organ.cut):
            behind = mesh.translate(-200 * TOWARD)
            plotter.add_mesh(behind, color="#dfe3e8", lighting=False)
    plotter.camera_position = [FOCUS + 600 * TOWARD, FOCUS, (0, 0, 1)]
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = HALF_HEIGHT_MM
    plotter.camera.clipping_range = (1, 2000)


def draw(organ, grids, tool_mm):
    """Both panels beside each other, as an image."""
    plotter = pv.Plotter(off_screen=True, shape=(1, 2), border=False, lighting="light kit",
                         window_size=(WIDTH * FINER, HEIGHT * FINER))
    plotter.set_background("white")
    for column, grid in enumerate(grids):
        plotter.subplot(0, column)
        panel(plotter, organ, grid, column * tool_mm)
    return Image.fromarray(plotter.screenshot(return_img=True))


def text(pen, place, words, size, colour=INK, anchor="ls"):
    """Writes words; place and size in pixels of the finished picture."""
    font = ImageFont.load_default(size * FINER)
    pen.text([c * FINER for c in place], words, fill=colour, font=font, anchor=anchor)


def legend(pen, materials):
    """The tissues and their stiffness, in a line at the bottom left."""
    x = 36
    for material in materials:
        kpa = material["young_modulus_pa"] / 1e3
        words = f"{material['name']} {kpa:g} kPa"
        colour = COLOURS.get(material["label"], STRESS_COLOURS[0])
        box = [(x - 7) * FINER, (665 - 7) * FINER, (x + 7) * FINER, (665 + 7) * FINER]
        pen.ellipse(box, fill=colour, outline=FAINT, width=FINER)
        text(pen, (x + 14, 665), words, 16, anchor="lm")
        x += 48 + ImageFont.load_default(16).getlength(words)


def colour_bar(picture, pen):
    """The scale of the stress, logarithmic, at the bottom right."""
    left, right, top, bottom = 1010, 1364, 640, 654
    ramp = LinearSegmentedColormap.from_list("stress", STRESS_COLOURS)
    strip = ramp(np.linspace(0, 1, (right - left) * FINER), bytes=True)[None, :, :3]
    strip = np.repeat(strip, (bottom - top) * FINER, axis=0)
    picture.paste(Image.fromarray(strip), (left * FINER, top * FINER))
    pen.rectangle([c * FINER for c in (left, top, right, bottom)], outline=FAINT, width=FINER)
    low, high = np.log10(STRESS_RANGE_PA)
    for power in range(round(low), round(high) + 1):
        x = left + (right - left) * (power - low) / (high - low)
        # Less, down to none at rest, takes the colour of the low end; no more is seen here.
        bound = "< " if power == low else ""
        text(pen, (x, bottom + 16), f"{bound}{10.0 ** (power - 3):g}", 15, anchor="mm")
    text(pen, (left - 12, (top + bottom) / 2), "von Mises stress, kPa", 16, anchor="rm")


def write(picture, first, pulled, tool_mm, materials):
    """Titles, legend and scale onto the drawing."""
    pen = ImageDraw.Draw(picture)
    titles = ("At rest", f"Left lobe pulled by {np.linalg.norm(tool_mm):.0f} mm")
    for column, (title, (at, grid)) in enumerate(zip(titles, (first, pulled))):
        x = 28 + column * WIDTH / 2
        text(pen, (x, 44), title, 26)
        count = f"t = {at:.2g} s, {grid.n_points} vertices, {grid.n_cells} tetrahedra"
        text(pen, (x, 70), count, 17, FAINT)
    legend(pen, materials)
    colour_bar(picture, pen)


def main():
    parser = argparse.ArgumentParser(description="Draws the liver at rest and at its largest pull.")
    parser.add_argument("run", type=Path, help="the run directory")
    parser.add_argument("voxels", type=Path, help="the phantom as a mesh of one voxel a cube")
    parser.add_argument("out", type=Path, help="the PNG to write")
    arguments = parser.parse_args()
    scene = tomllib.loads((arguments.run / "scene.toml").read_text())
    first, pulled = largest_pull(arguments.run)
    organ = Organ(*voxels(arguments.voxels, scene["image"]["length_mm"]))
    tool_mm = np.array(scene["tools"][0]["path"][-1]["move_m"]) * 1e3
    picture = draw(organ, [first[1], pulled[1]], tool_mm)
    write(picture, first, pulled, tool_mm, scene["materials"])
    picture = picture.resize((WIDTH, HEIGHT), Image.LANCZOS)
    # Six bits a channel look the same and take a third off the file.
    picture.point(lambda c: min(255, (c + 2) // 4 * 4)).save(arguments.out, optimize=True)


if __name__ == "__main__":
    main()
