"""The reconstruction inside the .blend, in double precision.

Object transforms and vertices are float32 and a user may edit them, so the engine reads what structure
from motion found from custom property arrays of the point cloud's mesh, where it is kept to the last bit.
"""

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.base.errors import UserError
from ...core.camera.distortion import FAMILIES, PARAMETERS, term_names
from ...core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction

PREFIX = "virtual_aperture_"
VERSION = 4
READABLE = 3, VERSION
"""Versions that can be read."""
LEFT_OUT = "visible_counts", "visible_points"
"""Arrays of version 3 that are not read: points that frames show and did not track."""
READOUT = PREFIX + "readout"
IS_ORDERED = PREFIX + "is_ordered"
ROW = "width", "height", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"
"""Fields of `Intrinsics`, of which a camera has a row."""
MODELS = tuple(PARAMETERS)
MOST_TERMS = max(len(term_names(family)) for family in FAMILIES)
ID_ATTRIBUTE = "point"
"""Vertex attribute with the point's ID: vertices may be deleted, IDs stay."""
HIDDEN = "Hidden"
"""Name of the modifier that leaves no vertex to draw outside of Edit Mode, and of its empty vertex group."""


def write(mesh: bpy.types.Mesh, reconstruction: Reconstruction) -> None:
    """Keep a reconstruction in a mesh's custom properties, replacing the one that was there."""
    cameras, images, points = reconstruction.cameras, reconstruction.images, reconstruction.points
    arrays: dict[str, NDArray[np.float64] | NDArray[np.int32]] = {
        "cameras": np.array([[getattr(c, name) for name in ROW] for c in cameras]).ravel(),
        "lens_models": np.array([MODELS.index(c.model) for c in cameras], dtype=np.int32),
        "lens_terms": np.array([np.pad(c.terms, (0, MOST_TERMS - len(c.terms))) for c in cameras]).ravel(),
        "frames": reconstruction.frames,
        "image_cameras": np.array([i.camera for i in images], dtype=np.int32),
        "rotations": np.array([i.rotation for i in images]).ravel(),
        "translations": np.array([i.translation for i in images]).ravel(),
        "counts": np.array([len(i.points) for i in images], dtype=np.int32),
        "seen_points": np.concatenate([i.points for i in images]).astype(np.int32),
        "seen_xy": np.concatenate([i.xy for i in images]).ravel(),
        "xyz": points.xyz.ravel(),
        "rgb": points.rgb.astype(np.int32).ravel(),
        "error": points.error,
    }
    mesh[PREFIX + "version"] = VERSION
    mesh[IS_ORDERED] = reconstruction.is_ordered
    mesh[READOUT] = reconstruction.readout
    for name in (*arrays, *LEFT_OUT):
        # Blender 5.2 writes an array over one of another length in place, past its end.
        if PREFIX + name in mesh:
            del mesh[PREFIX + name]
    for name, array in arrays.items():
        mesh[PREFIX + name] = np.ascontiguousarray(array)


def is_ordered(mesh: bpy.types.Mesh) -> bool:
    """Return whether a mesh that keeps a reconstruction keeps a clip's, not one of photos in no order."""
    return bool(mesh.get(IS_ORDERED, True))


def read(mesh: bpy.types.Mesh) -> Reconstruction:
    """Return the reconstruction kept in a mesh; UserError if there is none or a newer version wrote it."""
    version = mesh.get(PREFIX + "version")
    if version is None:
        raise UserError(f"the mesh {mesh.name!r} holds no solve; solve the clip or import a solve of it")
    if version not in READABLE:
        raise UserError(
            f"another version of Virtual Aperture made the solve in {mesh.name!r}; update the extension, or"
            " solve the clip again"
        )

    def array(name: str) -> NDArray[np.float64]:
        return np.array(mesh[PREFIX + name], dtype=np.float64)

    def integers(name: str) -> NDArray[np.int32]:
        return np.array(mesh[PREFIX + name], dtype=np.int32)

    rotations = array("rotations").reshape(-1, 3, 3)
    translations = array("translations").reshape(-1, 3)
    splits = np.cumsum(integers("counts"))[:-1]
    seen = np.split(integers("seen_points"), splits)
    xy = np.split(array("seen_xy").reshape(-1, 2), splits)
    cameras = integers("image_cameras")
    images = tuple(
        Image(int(frame), rotations[i], translations[i], xy[i], seen[i], int(cameras[i]))
        for i, frame in enumerate(integers("frames"))
    )
    points = Points(
        array("xyz").reshape(-1, 3), integers("rgb").reshape(-1, 3).astype(np.uint8), array("error")
    )
    rows = array("cameras").reshape(-1, len(ROW))
    terms = array("lens_terms").reshape(len(rows), -1)
    lenses = tuple(
        _intrinsics(row, MODELS[model], more)
        for row, model, more in zip(rows, integers("lens_models"), terms, strict=True)
    )
    across, down = mesh[READOUT]
    return Reconstruction(lenses, images, points, is_ordered(mesh), (float(across), float(down)))


def _intrinsics(row: NDArray[np.float64], model: str, terms: NDArray[np.float64]) -> Intrinsics:
    count = 0 if model == "OPENCV" else len(term_names(model))
    numbers = dict(zip(ROW[2:], row[2:].tolist(), strict=True))
    return Intrinsics(int(row[0]), int(row[1]), **numbers, model=model, terms=tuple(terms[:count].tolist()))


def is_shown(thing: bpy.types.Object) -> bool:
    """Return whether the point cloud's vertices are drawn in Object Mode."""
    modifier = thing.modifiers.get(HIDDEN)
    return modifier is None or not modifier.show_viewport


def show(thing: bpy.types.Object, shown: bool) -> None:
    """Have the vertices drawn in Object Mode, or not."""
    make_hidden(thing)
    thing.modifiers[HIDDEN].show_viewport = not shown


def make_hidden(thing: bpy.types.Object) -> None:
    """Hide the vertices in Object Mode, unless `show` has shown them: they would cover the clip.

    The object stays visible, because Tab edits no hidden one, and in Edit Mode all vertices are there.
    """
    # The mesh keeps the groups, and loses them when it is filled anew.
    if HIDDEN not in thing.vertex_groups:
        thing.vertex_groups.new(name=HIDDEN)
    if HIDDEN not in thing.modifiers:
        thing.modifiers.new(HIDDEN, "MASK").vertex_group = HIDDEN


def fill(mesh: bpy.types.Mesh, reconstruction: Reconstruction) -> None:
    """Vertices with colour, reprojection error and number of frames, none selected; vertex i is point i."""
    points = reconstruction.points
    count = len(points)
    mesh.clear_geometry()
    mesh.vertices.add(count)
    # Else the first Tab would have all of them selected.
    mesh.vertices.foreach_set("select", np.zeros(count, dtype=bool))
    mesh.attributes["position"].data.foreach_set("vector", points.xyz.astype(np.float32).ravel())
    colour = np.ones((count, 4), dtype=np.float32)
    colour[:, :3] = points.rgb / 255
    # Byte colours are stored display encoded, as the picture's own pixels are.
    mesh.color_attributes.new("colour", "BYTE_COLOR", "POINT").data.foreach_set("color_srgb", colour.ravel())
    mesh.attributes.new("reprojection_error", "FLOAT", "POINT").data.foreach_set(
        "value", points.error.astype(np.float32)
    )
    mesh.attributes.new("frames", "INT", "POINT").data.foreach_set("value", reconstruction.views_per_point)
    mesh.attributes.new(ID_ATTRIBUTE, "INT", "POINT").data.foreach_set(
        "value", np.arange(count, dtype=np.int32)
    )
    mesh.update()
