// Plays a baked clip in Unity. Use it in a Custom Function node of Shader Graph in the vertex stage, with this file
// as source and the name BakedVertex. Its inputs are vertex (UV1, the second set, which is the pixel of a vertex),
// seconds, and the textures as Bare Texture 2D. See metadata.json for the numbers.
//
// Import position_high.png, position_low.png and normal.png with sRGB off, Non-Power of 2 "None", no mip maps, no
// compression, filter "Point", and a max size of at least their size.
// Importers of glTF mirror x and flip texture coordinates (v becomes 1 - v), and a texture's first row is its
// lowest. This shader undoes all three. Set the renderer's bounds from lowest to highest.
#ifndef TAICHI_SOFT_BAKED_VERTEX
#define TAICHI_SOFT_BAKED_VERTEX

static const float3 Lowest = float3(@lowest@); // m
static const float3 Highest = float3(@highest@); // m
static const int FrameCount = @frame_count@;
static const int RowsPerFrame = @rows_per_frame@;
static const float Fps = @fps@;

int3 BakedPixel(float2 vertex, int frame, float2 size)
{
    int column = int(vertex.x * size.x);
    int row = frame * RowsPerFrame + int((1.0 - vertex.y) * float(RowsPerFrame));
    return int3(column, int(size.y) - 1 - row, 0);
}

float3 BakedPosition(Texture2D high, Texture2D low, int3 pixel)
{
    float3 share = (high.Load(pixel).rgb * 65280.0 + low.Load(pixel).rgb * 255.0) / 65535.0;
    float3 place = Lowest + (Highest - Lowest) * share;
    return float3(-place.x, place.y, place.z);
}

float3 BakedNormal(Texture2D map, int3 pixel)
{
    float3 normal = map.Load(pixel).rgb * 2.0 - 1.0;
    return float3(-normal.x, normal.y, normal.z);
}

// seconds is the time since the clip began. The clip loops.
void BakedVertex_float(
    float2 vertex, float seconds, Texture2D high, Texture2D low, Texture2D map, out float3 position, out float3 normal)
{
    float width, height;
    high.GetDimensions(width, height);
    float2 size = float2(width, height);
    float frame = fmod(max(seconds, 0.0) * Fps, float(FrameCount));
    int before = min(int(frame), FrameCount - 1);
    int3 one = BakedPixel(vertex, before, size);
    int3 other = BakedPixel(vertex, min(before + 1, FrameCount - 1), size);
    float share = frac(frame);
    position = lerp(BakedPosition(high, low, one), BakedPosition(high, low, other), share);
    normal = normalize(lerp(BakedNormal(map, one), BakedNormal(map, other), share));
}

#endif
