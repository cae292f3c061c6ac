"""Views of a warp mesh drawn with Blender's gpu module and averaged in linear light.

A view of a triangle is an affine warp (see `core/warp/mesh.py`), so a vertex shader that shifts vertices by
their inverse depth draws exactly what a virtual pinhole camera sees.
"""

import contextlib
import ctypes
import sys
from collections.abc import Sequence

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

from ...core.base.arrays import LinearRGBA
from ...core.base.errors import UserError
from ...core.frame.views import Views
from ...core.frame.vignetting import barrel_rows, matte_box_shift, view_shares
from ...core.optics.aberrations import COMA_LENGTH
from ...core.warp.layer import Layer, atlas, joined
from ...core.warp.mesh import WarpMesh
from ...scene.gpu.gpu_sweep_shaders import ON_SCREEN, SCREEN
from ...scene.gpu.main_thread import Steps, draw, leave_shader
from .quiet import quiet

SYNC = 4
"""Views between two waits for the GPU, by reading one pixel. Without them it would queue all views at once,
and progress and ESC would come before the work."""
VIEW_VERTEX = """
void main()
{
    vec2 seen = vec2(dot(row_x.xy, xy), dot(row_y.xy, xy)) + vec2(row_x.z, row_y.z)
        - vec2(row_x.w, row_y.w) * contrast;
    if (bend.zw != vec2(0.0)) {
        /* Aberrations, as `core.optics.aberrations` has them. */
        vec2 from = seen - middle;
        float along = dot(bend.xy, from);
        seen += bend.z * (dot(from, from) * bend.xy - along * from)
            + bend.w * (2.0 * along * bend.xy + dot(bend.xy, bend.xy) * from);
    }
    vec2 ndc = 2.0 * seen / size - 1.0;
    place = texture_xy;
    /* Pixels count from the top, the framebuffer from the bottom. Nearer vertices win. */
    gl_Position = vec4(ndc.x, -ndc.y, 0.98 * (1.0 - 2.0 * nearness), 1.0);
}
"""
VIEW_FRAGMENT = """
void main()
{
    colour = texture(picture, place);
    /* Nothing hides nothing. */
    if (colour.a == 0.0)
        discard;
}
"""
SUM_FRAGMENT = """
/* Catmull-Rom's, of four texels for a place that far past the second one: linear ones would blur twice. */
vec4 weights(float x)
{
    return vec4(x * (x * (1.0 - 0.5 * x) - 0.5), 1.0 + x * x * (1.5 * x - 2.5),
        x * (x * (2.0 - 1.5 * x) + 0.5), 0.5 * x * x * (x - 1.0));
}

vec4 moved(vec2 place)
{
    ivec2 first = ivec2(floor(place - 0.5)), last = textureSize(view, 0) - 1;
    vec4 across = weights(fract(place.x - 0.5)), up = weights(fract(place.y - 0.5)), found = vec4(0.0);
    for (int row = 0; row < 4; row++)
        for (int column = 0; column < 4; column++)
            found += across[column] * up[row]
                * texelFetch(view, clamp(first + ivec2(column, row) - 1, ivec2(0), last), 0);
    return max(found, 0.0);
}

void main()
{
    vec2 place = gl_FragCoord.xy * vec2(1.0, -1.0) - middle.xy;
    float light = clamp(middle.w * (1.0 + middle.z - length(barrel.xy + barrel.z * place)), 0.0, 1.0);
    if (matte_box != vec2(0.0)) {
        vec2 cut = clamp(middle.w * (1.0 + middle.z - abs(barrel.xy + matte_box * place)), 0.0, 1.0);
        light = (barrel.z > 0.0 ? light : 1.0) * cut.x * cut.y;
    }
    vec4 seen = texelFetch(view, ivec2(gl_FragCoord.xy), 0);
    if (axial != vec2(0.0)) {
        /* With another focal plane in register the view is moved. It stays as opaque as green is. */
        vec4 other = moved(gl_FragCoord.xy + axial);
        seen.rb = other.a > 0.01 ? other.rb * (seen.a / other.a) : seen.rb;
    }
    bool is_cut = barrel.z > 0.0 || matte_box != vec2(0.0);
    colour = (is_cut ? light * barrel.w : barrel.w) * seen;
}
"""


def gpu_problem() -> str:
    """Return the reason why there is no GPU context, or "". Starts the context in background mode."""
    problem = egl_problem()
    if problem:
        return problem
    try:
        if bpy.app.background:
            # Without a screen EGL tries three kinds of surface and complains of each before one works.
            with quiet(2):
                gpu.init()
        gpu.platform.renderer_get()
    except Exception as error:  # the module raises SystemError or RuntimeError, depending on the platform
        return str(error) or type(error).__name__
    return ""


def check_gpu() -> None:
    """Check that a GPU context can be made.

    Raises:
        UserError: It cannot; the message names packages to install.
    """
    problem = gpu_problem()
    if problem:
        raise UserError(
            f"views cannot be drawn without a GPU context ({problem}); install a graphics driver, or one that"
            " draws in software: libegl1, libgl1 and libgl1-mesa-dri on Debian and Ubuntu, mesa-libEGL and"
            " mesa-dri-drivers on Fedora"
        )


def start_gpu() -> None:
    """Have a GPU context where one can be had: depth is found without, too, but a real GPU sweeps faster."""
    with contextlib.suppress(UserError):
        check_gpu()


def egl_problem() -> str:
    """Return the reason why EGL has no display, or "": without a driver Blender crashes."""
    if not bpy.app.background or sys.platform != "linux":
        return ""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return "libEGL is not installed"
    egl.eglGetDisplay.restype = ctypes.c_void_p
    egl.eglGetDisplay.argtypes = [ctypes.c_void_p]
    return "" if egl.eglGetDisplay(None) else "EGL finds no driver"


def _shaders() -> tuple[gpu.types.GPUShader, gpu.types.GPUShader]:
    # Made anew for every frame: a shader that is kept is freed after its context, which crashes Blender
    # on exit.
    between = gpu.types.GPUStageInterfaceInfo("va_view")
    between.smooth("VEC2", "place")
    view = gpu.types.GPUShaderCreateInfo()
    for name in ("row_x", "row_y"):
        view.push_constant("VEC4", name)
    view.push_constant("VEC4", "bend")
    for name in ("size", "middle"):
        view.push_constant("VEC2", name)
    view.sampler(0, "FLOAT_2D", "picture")
    view.vertex_in(0, "VEC2", "xy")
    view.vertex_in(1, "VEC2", "texture_xy")
    view.vertex_in(2, "FLOAT", "nearness")
    view.vertex_in(3, "FLOAT", "contrast")
    view.vertex_out(between)
    view.fragment_out(0, "VEC4", "colour")
    view.vertex_source(VIEW_VERTEX)
    view.fragment_source(VIEW_FRAGMENT)
    add = gpu.types.GPUShaderCreateInfo()
    for name in ("barrel", "middle"):
        add.push_constant("VEC4", name)
    for name in ("axial", "matte_box"):
        add.push_constant("VEC2", name)
    add.sampler(0, "FLOAT_2D", "view")
    add.vertex_in(0, "VEC2", "xy")
    add.fragment_out(0, "VEC4", "colour")
    add.vertex_source(ON_SCREEN)
    add.fragment_source(SUM_FRAGMENT)
    return gpu.shader.create_from_info(view), gpu.shader.create_from_info(add)


def mean_of_views(views: Views, layers: Sequence[Layer]) -> LinearRGBA:
    """Return the mean of all views of layers in linear light, in the geometry of the views' canvas.

    Pixels that no triangle covers count as black and transparent. Passes checkpoints between views. Raises
    UserError where the picture is too large for the GPU or the memory, or the GPU gave nothing or values that
    are not finite.
    """
    limit = gpu.capabilities.max_texture_size_get()
    width, height = views.canvas.pinhole.width, views.canvas.pinhole.height
    if max(width, height) > limit:
        raise UserError(
            f"the picture is {width}x{height}, the GPU draws at most {limit} pixels a side; scale it"
        )
    try:
        picture = atlas(layers)
        mean = draw(_drawing(views, joined(layers), picture), len(views.offsets))
    except MemoryError:
        raise UserError(
            f"there is not enough memory to draw a picture of {width}x{height}; render at a lower percentage"
        ) from None
    if not np.isfinite(mean).all() or (picture[..., 3].any() and not mean[..., 3].any()):
        raise UserError(
            "the GPU returned an empty or broken picture, as happens when its driver restarts or it runs"
            " out of memory; render again, or at a lower percentage"
        )
    return mean


def _drawing(views: Views, mesh: WarpMesh, picture: LinearRGBA) -> Steps[LinearRGBA]:
    """Draw the views one by one; everything on the GPU is made, used and freed by the thread that steps.

    Every window has a GPU context, and between two steps another one may become active. Textures, vertex
    buffers and shaders are shared by all of them, and batches make their vertex arrays anew in another
    context (`GLVaoCache::context_check`; Vulkan and Metal keep none). Framebuffers belong to the context that
    made them, on OpenGL, Vulkan and Metal alike: each step makes them anew.
    """
    width, height = views.canvas.pinhole.width, views.canvas.pinhole.height
    source = upload(picture)
    source.filter_mode(True)
    source.extend_mode("MIRRORED_REPEAT")
    view = _texture(width, height)
    depth = _texture(width, height, "DEPTH_COMPONENT32F")
    total = _texture(width, height)
    view_shader, sum_shader = _shaders()
    triangles = np.ascontiguousarray(mesh.triangles, dtype=np.int32)
    batch = batch_for_shader(view_shader, "TRIS", vertex_arrays(views, mesh, picture), indices=triangles)
    screen = batch_for_shader(sum_shader, "TRIS", {"xy": SCREEN})
    total.clear(format="FLOAT", value=(0.0, 0.0, 0.0, 0.0))
    # From the framebuffer's bottom left, with y up, to pixels from the picture's middle with y down.
    principal = views.canvas.pinhole.principal_point
    middle, matte_box = principal - np.array([0, height]), matte_box_shift(views)
    coefficients = zip(
        view_rows(views, mesh),
        barrel_rows(views),
        view_shares(views),
        axial_rows(views),
        bend_rows(views),
        strict=True,
    )
    for n, (rows, barrel, share, axial, bend) in enumerate(coefficients):
        yield n
        view_target = gpu.types.GPUFrameBuffer(depth_slot=depth, color_slots=(view,))
        sum_target = gpu.types.GPUFrameBuffer(color_slots=(total,))
        with view_target.bind():
            view_target.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
            gpu.state.depth_test_set("LESS_EQUAL")
            gpu.state.depth_mask_set(True)
            # Triangles come from far to near: half covered pixels lie over what is behind them.
            gpu.state.blend_set("ALPHA_PREMULT")
            view_shader.bind()
            view_shader.uniform_float("row_x", rows[0].tolist())
            view_shader.uniform_float("row_y", rows[1].tolist())
            view_shader.uniform_float("size", (width, height))
            view_shader.uniform_float("middle", principal.tolist())
            view_shader.uniform_float("bend", bend.tolist())
            view_shader.uniform_sampler("picture", source)
            batch.draw(view_shader)
        with sum_target.bind():
            # The state is reset by every bind: without this the sum would be the last view alone.
            gpu.state.depth_test_set("NONE")
            gpu.state.depth_mask_set(False)
            gpu.state.blend_set("ADDITIVE_PREMULT")
            sum_shader.bind()
            sum_shader.uniform_float("barrel", [*barrel[:3].tolist(), float(share)])
            sum_shader.uniform_float("middle", [*middle.tolist(), *barrel[3:].tolist()])
            sum_shader.uniform_float("axial", axial.tolist())
            sum_shader.uniform_float("matte_box", matte_box.tolist())
            sum_shader.uniform_sampler("view", view)
            screen.draw(sum_shader)
            if n % SYNC == SYNC - 1:
                sum_target.read_color(0, 0, 1, 1, 4, 0, "FLOAT")
            gpu.state.blend_set("NONE")
        leave_shader()
        del view_target, sum_target
    return _download(total, width, height) / np.float32(len(views.offsets))


def vertex_arrays(views: Views, mesh: WarpMesh, picture: LinearRGBA) -> dict[str, NDArray[np.float32]]:
    """Return the vertex shader's attributes.

    `xy` (V, 2) is in pixels; `texture_xy` (V, 2) in shares of the texture's size; `nearness` (V,) is inverse
    depth over the largest one; `contrast` (V,) is inverse depth relative to the focal plane, over the largest
    one. The difference is computed here in double precision: on the GPU the focal plane's displacement would
    cancel the last digits.
    """
    nearest = float(mesh.nearness.max(initial=0.0)) or 1.0
    contrast = mesh.inverse_depth - views.lens.focus
    return {
        "xy": np.ascontiguousarray(mesh.xy, dtype=np.float32),
        "texture_xy": np.ascontiguousarray(mesh.texture_xy / picture.shape[1::-1], dtype=np.float32),
        "nearness": np.ascontiguousarray(mesh.nearness / nearest, dtype=np.float32),
        "contrast": np.ascontiguousarray(contrast / _largest_contrast(views, mesh), dtype=np.float32),
    }


def view_rows(views: Views, mesh: WarpMesh) -> NDArray[np.float32]:
    """Return coefficients a, b, c, d (N, 2, 4) for each view and axis.

    A vertex is seen at a x + b y + c - d contrast, in pixels. `benchmarks.displaced` has these terms in
    another order: here the motion of the focal plane is in c.
    """
    turn, shift = views.registration[:, :, :2], views.canvas.pinhole.focal * views.offsets
    turned = np.einsum("nij,nj->ni", turn, shift)
    rows = np.concatenate([views.registration, turned[:, :, None]], axis=2)
    rows[:, :, 2] -= turned * views.lens.focus
    rows[:, :, 3] *= _largest_contrast(views, mesh)
    if sideways := views.aberrations.anamorphic_focus:
        rows[:, 0, 2] += views.reach * sideways * views.places[:, 0]
    return rows.astype(np.float32)


def bend_rows(views: Views) -> NDArray[np.float32]:
    """Return coefficients (N, 4) of each view's aberrations.

    They are its place x, y on the aperture, and the factors of swirl and coma by pixels from the middle.
    """
    swirl = views.aberrations.swirl / views.half_diagonal**2
    coma = views.aberrations.coma / COMA_LENGTH / views.half_diagonal
    factors = views.reach * np.array([swirl, coma])
    return np.column_stack([views.places, np.tile(factors, (len(views.offsets), 1))]).astype(np.float32)


def axial_rows(views: Views) -> NDArray[np.float32]:
    """Return shifts (N, 2) in pixels to the right and up that each view of red and blue needs.

    They put the focal plane of these colours in register.
    """
    shift = views.axial_shift * views.canvas.pinhole.focal * views.offsets
    return np.asarray(np.einsum("nij,nj->ni", views.registration[:, :, :2], shift) * [1, -1], np.float32)


def _largest_contrast(views: Views, mesh: WarpMesh) -> float:
    return float(np.abs(mesh.inverse_depth - views.lens.focus).max(initial=0.0)) or 1.0


def upload(picture: LinearRGBA) -> gpu.types.GPUTexture:
    """Return a texture of a picture (h, w, 4), whose first row has the texture coordinate 0.

    Raises:
        UserError: It is too large for the driver.
    """
    height, width = picture.shape[:2]
    data = np.ascontiguousarray(picture, dtype=np.float32).reshape(-1)
    return _texture(width, height, data=gpu.types.Buffer("FLOAT", data.size, data))


def _texture(
    width: int, height: int, format: str = "RGBA32F", data: gpu.types.Buffer | None = None
) -> gpu.types.GPUTexture:
    """A texture; UserError where the graphics driver cannot make one so large."""
    try:
        return gpu.types.GPUTexture((width, height), format=format, data=data)
    except RuntimeError:
        raise UserError(
            f"the graphics driver cannot hold pictures of {width} x {height} pixels, because of its memory"
            " or its own limits; make the picture smaller, or use another machine"
        ) from None


def _download(texture: gpu.types.GPUTexture, width: int, height: int) -> LinearRGBA:
    buffer = texture.read()
    buffer.dimensions = width * height * 4
    # The framebuffer's first row is the bottom one.
    return np.frombuffer(buffer, dtype=np.float32).reshape(height, width, 4)[::-1].copy()
