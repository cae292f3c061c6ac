"""Shaders of the plane sweep on a GPU, in the GLSL that Blender brings to OpenGL, Vulkan and Metal.

Each does what the function it names does in NumPy and OpenCV. A texel holds four levels of a pixel, the next
layer of a texture the next four. Pictures' rows count from the top in all of them.
"""

from dataclasses import dataclass

import gpu
import numpy as np

MISMATCH = """
/* `View.warped` with zero around, times 255. */
vec4 texel_of(ivec2 at, int view)
{
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, textureSize(pictures, 0).xy)))
        return vec4(0.0);
    return texelFetch(pictures, ivec3(at, view), 0);
}

vec4 seen(vec3 place, int view)
{
    vec2 at = abs(place.z) > 0.0 ? place.xy / place.z : vec2(0.0);
    at = clamp(at, vec2(-4.0), vec2(textureSize(pictures, 0).xy) + 4.0);
    ivec2 first = ivec2(floor(at));
    vec2 share = at - floor(at);
    vec4 above = mix(texel_of(first, view), texel_of(first + ivec2(1, 0), view), share.x);
    vec4 below = mix(texel_of(first + ivec2(0, 1), view), texel_of(first + ivec2(1, 1), view), share.x);
    return floor(255.0 * mix(above, below, share.y) + 0.5);
}

/* `plane_sweep._mismatch` before it is gathered: the mean, or less than zero where no view sees it. */
void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = textureSize(frame, 0);
    if (any(greaterThanEqual(at, size)))
        return;
    vec3 own = floor(255.0 * texelFetch(frame, at, 0).rgb + 0.5);
    for (int side = 0; side < sides; side++) {
        vec4 total = vec4(0.0);
        vec4 count = vec4(0.0);
        for (int view = side == 0 ? 0 : split; view < (side == 0 ? split : views); view++) {
            for (int k = 0; k < 4; k++) {
                int level = min(4 * quad + k, levels - 1);
                vec4 row_x = texelFetch(planes, ivec2(3 * view, level), 0);
                if (row_x.w == 0.0)
                    continue;
                vec3 row_y = texelFetch(planes, ivec2(3 * view + 1, level), 0).xyz;
                vec3 row_z = texelFetch(planes, ivec2(3 * view + 2, level), 0).xyz;
                vec3 here = vec3(vec2(at), 1.0);
                vec4 there = seen(vec3(dot(row_x.xyz, here), dot(row_y, here), dot(row_z, here)), view);
                if (there.a < 254.0)
                    continue;
                /* OpenCV's whole-numbered grey of the difference. */
                float off = dot(abs(own - there.rgb), vec3(9798.0, 19235.0, 3735.0));
                total[k] += min(floor((off + 16384.0) / 32768.0), truncation);
                count[k] += 1.0;
            }
        }
        vec4 mean = steps * total / max(count, vec4(1.0));
        vec4 none = vec4(equal(count, vec4(0.0)));
        imageStore(means, ivec3(at, side), mix(mean, vec4(-steps * truncation), none));
    }
}
"""
MIRRORED = """
/* A place past the border, as OpenCV's BORDER_REFLECT has it. */
ivec2 mirrored(ivec2 at, ivec2 size)
{
    at = max(at, -1 - at);
    return clamp(min(at, 2 * size - 1 - at), ivec2(0), size - 1);
}
"""
SLOPES = (
    MIRRORED
    + """
/* The first half of OpenCV's guided filter: the line of costs over grey levels around each pixel; and whether
   a view is missing there. Layers of each side: slope, height at no grey, missing. */
void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = textureSize(guide, 0);
    if (any(greaterThanEqual(at, size)))
        return;
    vec4 here = texelFetch(guide, at, 0);
    float count = float((2 * radius + 1) * (2 * radius + 1));
    for (int side = 0; side < sides; side++) {
        vec4 sum = vec4(0.0);
        vec4 product = vec4(0.0);
        vec4 missing = vec4(0.0);
        for (int y = -radius; y <= radius; y++) {
            for (int x = -radius; x <= radius; x++) {
                ivec2 there = mirrored(at + ivec2(x, y), size);
                vec4 cost = texelFetch(means, ivec3(there, side), 0);
                missing = max(missing, vec4(lessThan(cost, vec4(0.0))));
                cost = abs(cost);
                sum += cost;
                /* About the mean: sums of squares of 255 would take the last digits with them. */
                product += cost * (texelFetch(guide, there, 0).x - here.y);
            }
        }
        vec4 slope = product / count * here.z;
        imageStore(lines, ivec3(at, 3 * side), slope);
        imageStore(lines, ivec3(at, 3 * side + 1), sum / count - slope * here.y);
        imageStore(lines, ivec3(at, 3 * side + 2), missing);
    }
}
"""
)
GATHER = (
    MIRRORED
    + """
/* The second half of the guided filter; the better side; UNSEEN (65535) where none sees all around. */
void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = textureSize(guide, 0);
    if (any(greaterThanEqual(at, size)))
        return;
    float grey = texelFetch(guide, at, 0).x;
    float count = float((2 * radius + 1) * (2 * radius + 1));
    vec4 best = vec4(65534.0);
    vec4 hidden = vec4(1.0);
    for (int side = 0; side < sides; side++) {
        vec4 slope = vec4(0.0);
        vec4 height = vec4(0.0);
        vec4 missing = vec4(0.0);
        for (int y = -radius; y <= radius; y++) {
            for (int x = -radius; x <= radius; x++) {
                ivec2 there = mirrored(at + ivec2(x, y), size);
                slope += texelFetch(lines, ivec3(there, 3 * side), 0);
                height += texelFetch(lines, ivec3(there, 3 * side + 1), 0);
                missing = max(missing, texelFetch(lines, ivec3(there, 3 * side + 2), 0));
            }
        }
        best = min(best, (slope * grey + height) / count);
        hidden = min(hidden, missing);
    }
    vec4 found = mix(clamp(floor(best + 0.5), vec4(0.0), vec4(65534.0)), vec4(65535.0), hidden);
    imageStore(costs, ivec3(at, quad), uvec4(found));
}
"""
)
FINISH = """
/* `plane_sweep._finished`, the spread of costs over the levels, and `matching.known_levels` as a cost. */
void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = textureSize(guide, 0);
    if (any(greaterThanEqual(at, size)))
        return;
    bool outside = texelFetch(frame, at, 0).a < 0.999;
    float known = texelFetch(guide, at, 0).w;
    uint lowest = 65535u;
    for (int level = 0; level < levels; level++) {
        uint cost = texelFetch(raw, ivec3(at, level / 4), 0)[level % 4];
        uint more = uint(texelFetch(planes, ivec2(1, level), 0).w);
        lowest = cost == 65535u ? lowest : min(lowest, cost + more);
    }
    lowest = lowest == 65535u ? 0u : lowest;
    float sum = 0.0;
    for (int quad = 0; quad < (levels + 3) / 4; quad++) {
        uvec4 cost = texelFetch(raw, ivec3(at, quad), 0);
        for (int k = 0; k < 4; k++) {
            int level = 4 * quad + k;
            if (level >= levels) {
                cost[k] = 65535u;
                continue;
            }
            uint more = uint(texelFetch(planes, ivec2(1, level), 0).w);
            cost[k] = outside ? 0u : cost[k] == 65535u ? lowest : cost[k] + more;
            sum += float(cost[k]);
            if (known > unknown)
                cost[k] += uint(prior * min(abs(float(level) - known) / reach, 1.0) + 0.5);
        }
        imageStore(costs, ivec3(at, quad), cost);
    }
    imageStore(spreads, at, vec4(sum / float(levels) - (outside ? 0.0 : float(lowest))));
}
"""
PATHS = """
/* One way of `semiglobal._both_ways`: a thread goes along a scanline with all levels, QUADS times four. */
void main()
{
    ivec2 size = textureSize(guide, 0);
    int line = int(gl_GlobalInvocationID.x);
    if (line >= (across == 1 ? size.y : size.x))
        return;
    int last = (across == 1 ? size.x : size.y) - 1;
    uint small = uint(p1 + 0.5);
    uvec4 path[QUADS];
    for (int quad = 0; quad < QUADS; quad++)
        path[quad] = uvec4(0u);
    uint lowest = 0u;
    float before = 0.0;
    for (int n = 0; n <= last; n++) {
        int along = backwards == 1 ? last - n : n;
        ivec2 at = across == 1 ? ivec2(along, line) : ivec2(line, along);
        float grey = texelFetch(guide, at, 0).x;
        uint large = uint(max(p2 / (1.0 + abs(grey - before) / halved_at), 1.1 * p1) + 0.5);
        before = grey;
        uint least = 0xFFFFFFu;
        uint nearer = 0xFFFFFFu;
        for (int quad = 0; quad < QUADS; quad++) {
            uvec4 old = path[quad];
            uint farther = quad < QUADS - 1 ? path[min(quad + 1, QUADS - 1)].x : 0xFFFFFFu;
            uvec4 beside = min(uvec4(nearer, old.xyz), uvec4(old.yzw, farther)) + uvec4(small);
            nearer = old.w;
            uvec4 now = min(min(old, beside), uvec4(lowest + large)) - uvec4(lowest)
                + texelFetch(costs, ivec3(at, quad), 0);
            path[quad] = now;
            least = min(least, min(min(now.x, now.y), min(now.z, now.w)));
            uvec4 sum = now;
            if (adds == 1)
                sum += texelFetch(before_sums, ivec3(at, quad), 0);
            imageStore(sums, ivec3(at, quad), min(sum, uvec4(65535u)));
        }
        lowest = least;
    }
}
"""
SCREEN = np.array([[-1, -1], [3, -1], [-1, 3]], np.float32)
"""Clip coordinates of a triangle that covers the whole target,"""
ON_SCREEN = """
void main()
{
    gl_Position = vec4(xy, 0.0, 1.0);
}
"""
"""and the shader of its vertices."""
WINNERS = """
uint summed(ivec2 at, int level)
{
    return texelFetch(sums, ivec3(at, level / 4), 0)[level % 4];
}

/* `semiglobal.best_levels`, and what `matching.Winners` tells besides. */
void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    uint lowest = 65536u;
    int best = 0;
    for (int level = 0; level < levels; level++) {
        uint sum = summed(at, level);
        best = sum < lowest ? level : best;
        lowest = min(lowest, sum);
    }
    int rivals = 0;
    for (int level = 0; level < levels; level++)
        rivals += summed(at, level) < lowest + uint(margin) ? 1 : 0;
    best = clamp(best, 1, levels - 2);
    float here = float(summed(at, best));
    float before = float(summed(at, best - 1));
    float after = float(summed(at, best + 1));
    float rise = max(before, after) - here;
    float share = rise > 0.0 ? clamp((before - after) / (2.0 * rise), -1.0, 1.0) : 0.0;
    uint cost = texelFetch(costs, ivec3(at, best / 4), 0)[best % 4];
    winner = vec4(float(best) + share, float(rivals), float(cost), texelFetch(spreads, at, 0).x);
}
"""


@dataclass(frozen=True)
class Program:
    """The parts of a compute shader by name, in the order of their slots."""

    source: str
    numbers: tuple[str, ...] = ()
    """Whole numbers that it is given."""
    values: tuple[str, ...] = ()
    """Floats that it is given."""
    reads: tuple[tuple[str, str], ...] = ()
    """Textures, with their type."""
    writes: tuple[tuple[str, str, str], ...] = ()
    """Images, with their type and format."""
    group: tuple[int, int] = (8, 8)
    """Threads of a work group, across and down: 64, as many as the widest GPUs work at in step."""


PROGRAMS = {
    "mismatch": Program(
        MISMATCH, ("quad", "levels", "sides", "split", "views"), ("truncation", "steps"),
        (("frame", "FLOAT_2D"), ("pictures", "FLOAT_2D_ARRAY"), ("planes", "FLOAT_2D")),
        (("means", "FLOAT_2D_ARRAY", "RGBA32F"),),
    ),
    "slopes": Program(
        SLOPES, ("sides", "radius"), (), (("guide", "FLOAT_2D"), ("means", "FLOAT_2D_ARRAY")),
        (("lines", "FLOAT_2D_ARRAY", "RGBA32F"),),
    ),
    "gather": Program(
        GATHER, ("quad", "sides", "radius"), (), (("guide", "FLOAT_2D"), ("lines", "FLOAT_2D_ARRAY")),
        (("costs", "UINT_2D_ARRAY", "RGBA16UI"),),
    ),
    "finish": Program(
        FINISH, ("levels",), ("unknown", "prior", "reach"),
        (("frame", "FLOAT_2D"), ("guide", "FLOAT_2D"), ("planes", "FLOAT_2D"), ("raw", "UINT_2D_ARRAY")),
        (("costs", "UINT_2D_ARRAY", "RGBA16UI"), ("spreads", "FLOAT_2D", "R32F")),
    ),
    "paths": Program(
        PATHS, ("across", "backwards", "adds"), ("p1", "p2", "halved_at"),
        (("guide", "FLOAT_2D"), ("costs", "UINT_2D_ARRAY"), ("before_sums", "UINT_2D_ARRAY")),
        (("sums", "UINT_2D_ARRAY", "RGBA16UI"),), (32, 1),
    ),
}  # fmt: skip


def compute(name: str, quads: int) -> gpu.types.GPUShader:
    """Return one of `PROGRAMS`, compiled for a number of layers of four levels."""
    program, info = PROGRAMS[name], gpu.types.GPUShaderCreateInfo()
    for number in program.numbers:
        info.push_constant("INT", number)
    for value in program.values:
        info.push_constant("FLOAT", value)
    for slot, (texture, kind) in enumerate(program.reads):
        info.sampler(slot, kind, texture)
    for slot, (image, kind, texels) in enumerate(program.writes):
        info.image(slot, texels, kind, image, qualifiers={"WRITE"})
    info.define("QUADS", str(quads))
    info.local_group_size(*program.group)
    info.compute_source(program.source)
    return gpu.shader.create_from_info(info)


def winners() -> gpu.types.GPUShader:
    """Return the shader that draws the winners of all levels onto a screen of the picture's size.

    It draws, because the content of a framebuffer can be read at once on every backend.
    """
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("INT", "levels")
    info.push_constant("INT", "margin")
    info.sampler(0, "UINT_2D_ARRAY", "costs")
    info.sampler(1, "UINT_2D_ARRAY", "sums")
    info.sampler(2, "FLOAT_2D", "spreads")
    info.vertex_in(0, "VEC2", "xy")
    info.fragment_out(0, "VEC4", "winner")
    info.vertex_source(ON_SCREEN)
    info.fragment_source(WINNERS)
    return gpu.shader.create_from_info(info)
